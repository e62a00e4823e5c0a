"""A ring is rolled thinner between a driven main roll and a mandrel that is pressed towards it, and grows.

The upper half of the ring, by its mirror plane. The main roll turns and takes the ring along by friction; the mandrel, as
idle as a smooth one is, moves outwards by 1.6 mm a revolution at first; two guide rolls on soft springs keep the ring in
its place. Only what lies in the gap flows. The rest of the ring turns as a rigid body, by three degrees in a step: nodes
are moved by a scheme that is exact in rotations. Three revolutions, in which the wall goes from 12 to 7 mm.

That the ring turns at all is for its roll to see to. The friction m k on the arc L of the gap has to drive the draught d
through it against the pressure p,

    p d < m k L ,     L² = 2 d / (1/R_main + 1/R_mandrel + 1/R_outer - 1/R_inner) :

the greater the draught, the harder; where the ring slips, it is squeezed in its place. Large rolls give long arcs. A mesh
must leave room for that: elements as long as the arc bend over in the gap, and points that land there brake the ring with
the share v dt/L of the power. Two elements on the arc and four steps are the least; beyond that, as any mesh keeps it: the
balance of the rolls, the way of the rim with the main roll, the gap that the ring has gone through, and the growth,

    V = pi (R² - r²) h :     a ring that gets thinner must grow, or get higher.

    python3 demos/ring_rolling_3d.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress
from fenics_forming.results.pictures.skin import Skin

SCENE = Path(__file__).parent / "scenes" / "ring_rolling_3d.toml"
OUTER, INNER, HALF = 50.0, 38.0, 10.0       # radii and half the height of the ring, mm
MAIN, SPEED, FEED = 200.0, 0.4, 0.4         # radius of the main roll, mm, its speed, rad/s, and that of the mandrel, mm/s
AROUND, THROUGH = 60, 2                     # elements around the ring and through its wall


def main(coarse: bool = False, out: str | Path = "results/ring_rolling_3d", quiet: bool = False) -> ff.Results:
    """Roll the ring, compare, draw.

    Parameters
    ----------
    coarse : a twentieth of a revolution only
    out : folder for the mesh and the results
    quiet : print nothing
    """
    out = Path(out)
    ring = write_ring(out / "ring.msh")
    changes = [f"workpieces.ring.shape.path='{ring.resolve()}'"]
    scene = ff.read_scene(SCENE, set=changes + ["stop.time=0.26"] * coarse)
    with Progress(total=scene.stop.time, quiet=quiet) as progress:
        results = ff.simulate(scene, out, observer=progress)
    picture(results, Path(out) / "ring_rolling_3d.png")
    compare(compared(results), quiet=quiet)
    return results


def write_ring(path: Path) -> Path:
    """A regular mesh of tetrahedra with curved sides: the corners of straight ones would knock in the gap."""
    import gmsh
    path.parent.mkdir(parents=True, exist_ok=True)
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    geo = gmsh.model.geo
    centre, angles = geo.addPoint(0, 0, 0), 0.5 * np.pi * np.arange(4)
    points = [[geo.addPoint(r * np.cos(a), r * np.sin(a), 0) for a in angles] for r in (INNER, OUTER)]
    arcs = [[geo.addCircleArc(ring[k], centre, ring[(k + 1) % 4]) for k in range(4)] for ring in points]
    spokes = [geo.addLine(points[0][k], points[1][k]) for k in range(4)]
    for curves, count in (((*arcs[0], *arcs[1]), AROUND // 4), (spokes, THROUGH)):
        for curve in curves:
            geo.mesh.setTransfiniteCurve(curve, count + 1)
    volumes = []
    for k in range(4):
        face = geo.addPlaneSurface([geo.addCurveLoop([arcs[0][k], spokes[(k + 1) % 4], -arcs[1][k], -spokes[k]])])
        geo.mesh.setTransfiniteSurface(face)
        volumes += [tag for dim, tag in geo.extrude([(2, face)], 0, 0, HALF, numElements=[1]) if dim == 3]
    geo.synchronize()
    gmsh.model.addPhysicalGroup(3, volumes, 1)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.write(str(path))
    gmsh.finalize()
    return path


def section(results: ff.Results, frame: int = -1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle from the main roll, rad, in the sense in which the ring turns, thickness of the wall, and height, mm, at
    stations around the ring."""
    skin = Skin.read([results.frames[frame][1]])
    x = skin.points
    centre = 0.5 * (x[:, :2].max(axis=0) + x[:, :2].min(axis=0))
    radius, angle = np.linalg.norm(x[:, :2] - centre, axis=1), np.arctan2(*(x[:, :2] - centre).T[::-1])
    angle = (np.pi - angle) % (2 * np.pi)
    stations = 2 * np.pi * (np.arange(AROUND) + 0.5) / AROUND
    slot = np.minimum((angle * AROUND / (2 * np.pi)).astype(int), AROUND - 1)
    mean = 0.5 * (radius.max() + radius.min())
    outer, inner, top = (np.array([pick(values[slot == k]) for k in range(AROUND)]) for values, pick in (
        (np.where(radius > mean, radius, -np.inf), np.max), (np.where(radius < mean, radius, np.inf), np.min),
        (x[:, 2], np.max)))
    return stations, outer - inner, 2 * top


def turns(results: ff.Results) -> np.ndarray:
    """Revolutions of the ring until each step, of a mark on its rim about the place where its middle was at the start."""
    x, y = (results.history.column(f"mark_{axis}_mm") for axis in "xy")
    return np.abs(np.unwrap(np.arctan2(y, x))) / (2 * np.pi)


def compared(results: ff.Results) -> list[Compared]:
    """What any rolled ring keeps."""
    last, ledger = results.history.rows[-1], results.summary["ledger"]
    force = {name: results.history.column(f"force_{name}_N")[1:].mean() for name in ("main", "mandrel", "left", "right")}
    guides = np.cos(np.deg2rad(75)) * (force["left"] + force["right"])
    x, y = (results.history.column(f"mark_{axis}_mm") for axis in "xy")
    way = np.hypot(np.diff(x), np.diff(y)).sum()
    _, wall, height = section(results)
    (left, right), (near, far) = (results.summary["extents_mm"]["ring"][axis] for axis in "xy")
    # a station shows its thickest and highest place: what it has less elsewhere the ring has more in diameter
    diameter, thick, high = 0.5 * (right - left + far - near), wall.mean(), height.mean()
    grown = (OUTER**2 - INNER**2) * 2 * HALF / (thick * high) + thick
    return [
        Compared("force of the mandrel on the ring, kN", force["mandrel"] / 1e3, (force["main"] + guides) / 1e3, 0.02,
                 "main roll and guides"),
        Compared("way of a mark on the rim, mm", way, MAIN * SPEED * last["time_s"], 0.05, "carried by the roll"),
        Compared("thinnest place of the wall, mm", wall.min(), OUTER - INNER - FEED * last["time_s"], 0.02,
                 "gap of the rolls"),
        Compared("mean diameter outside, mm", diameter, grown, 0.04, "volume, wall and height"),
        Compared("change of volume, 1e-9", 1e9 * abs(last["volume_error_ring"]), 0.0, 1.0, "constancy", relative=False),
        Compared("powers that do not balance at worst, %", 100 * ledger["power"]["worst_relative_imbalance"], 0.0, 0.5,
                 "first law", relative=False)]


def picture(results: ff.Results, path: Path) -> None:
    """The ring between its rolls; forces and torque; the wall and the height around it."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 4.6), width_ratios=[1.2, 1, 1], layout="constrained")
    left.imshow(ff.plot_fields(results, "effective_strain"))
    left.axis("off")
    revolutions = turns(results)
    for name, label in (("mandrel", "mandrel"), ("main", "main roll"), ("left", "guide, left"), ("right", "guide, right")):
        middle.plot(revolutions, results.history.column(f"force_{name}_N") / 1e3, label=f"{label} (kN)")
    middle.plot(revolutions, results.history.column("torque_main_Nmm") / 1e5, "--", label="torque, main roll (100 Nm)")
    middle.set(xlabel="revolutions of the ring", ylim=(0, None))
    angle, wall, height = section(results)
    right.plot(np.rad2deg(angle), wall, label="wall")
    right.plot(np.rad2deg(angle), height, label="height")
    right.set(xlabel="behind the main roll (degrees)", ylabel="mm", ylim=(0, 25), xticks=range(0, 361, 90))
    for axes in (middle, right):
        axes.grid(True, linewidth=0.5, alpha=0.4)
        axes.legend(frameon=False, fontsize="small")
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
