"""A ring is rolled thinner between a driven main roll and a mandrel that is pressed towards it, and grows.

The upper half of the ring, by its mirror plane. The main roll turns and takes the ring along by friction; the mandrel, as
idle as a smooth one is, moves outwards by 2.75 mm a revolution; two guide rolls on springs keep the ring where it is. Only
what lies in the gap flows. The rest of the ring turns as a rigid body, by five degrees in a step: the nodes are moved by a
scheme that is exact in rotations. The mesh is coarse, two elements through the wall and one through the half of the height,
the gap about one of them long. In it they bend more than the metal would, and points that land there take a quarter of the
power, so the torque is too large. What is looked at is what any mesh keeps over the first half of a revolution: the balance
of the rolls, the way that the main roll takes the ring along, the gap that it has gone through, and the growth,

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
from fenics_forming.results.skin import Skin

SCENE = Path(__file__).parent / "scenes" / "ring_rolling_3d.toml"
OUTER, INNER, HALF = 50.0, 30.0, 10.0       # radii and half the height of the ring, mm
MAIN, SPEED = 80.0, 1.0                     # radius of the main roll, mm, and its speed, rad/s
TURN = 2 * np.pi * OUTER / (MAIN * SPEED)   # time of a revolution of the ring at the start, s
AROUND, THROUGH = 48, 2                     # elements around the ring and through its wall


def main(coarse: bool = False, out: str | Path = "results/ring_rolling_3d", quiet: bool = False) -> ff.Results:
    """Roll the ring, compare, draw.

    Parameters
    ----------
    coarse : a tenth of a revolution instead of a half
    out : folder for the mesh and the results
    quiet : print nothing
    """
    out = Path(out)
    ring = write_ring(out / "ring.msh")
    changes = [f"workpieces.ring.shape.path='{ring.resolve()}'"]
    scene = ff.read_scene(SCENE, set=changes + ["stop.time=0.4"] * coarse)
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


def compared(results: ff.Results) -> list[Compared]:
    """What any rolled ring keeps."""
    last, ledger = results.history.rows[-1], results.summary["ledger"]
    rows = [row for row in results.history.rows if row["dt_s"] > 0.05]      # no short steps, of which landing points press
    force = {name: np.mean([row[f"force_{name}_N"] for row in rows]) for name in ("main", "mandrel", "left", "right")}
    guides = np.cos(np.deg2rad(75)) * (force["left"] + force["right"])
    x, y = (results.history.column(f"mark_{axis}_mm") for axis in "xy")
    way = OUTER * np.abs(np.diff(np.unwrap(np.arctan2(y, x)))).sum()
    feed = 0.7 * last["time_s"]
    _, wall, height = section(results)
    return [
        Compared("force of the mandrel on the ring, kN", force["mandrel"] / 1e3, (force["main"] + guides) / 1e3, 0.01,
                 "main roll and guides"),
        Compared("way of a mark on the rim, mm", way, MAIN * SPEED * last["time_s"], 0.05, "carried by the roll"),
        Compared("thinnest place of the wall, mm", wall.min(), OUTER - INNER - feed, 0.02, "gap of the rolls"),
        Compared("highest place over the height at the start", height.max() / (2 * HALF), 1.0, 0.1, "spread is small"),
        Compared("change of volume, 1e-9", 1e9 * abs(last["volume_error_ring"]), 0.0, 1.0, "constancy", relative=False),
        Compared("powers that do not balance at worst, %", 100 * ledger["power"]["worst_relative_imbalance"], 0.0, 0.5,
                 "first law", relative=False)]


def picture(results: ff.Results, path: Path) -> None:
    """The ring between its rolls; forces and torque; the wall and the height around it."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 4.6), width_ratios=[1.2, 1, 1], layout="constrained")
    left.imshow(ff.plot_fields(results, "effective_strain"))
    left.axis("off")
    turns = results.history.column("time_s") / TURN
    for name, label in (("mandrel", "mandrel"), ("main", "main roll"), ("left", "guide, left"), ("right", "guide, right")):
        middle.plot(turns, results.history.column(f"force_{name}_N") / 1e3, label=f"{label} (kN)")
    middle.plot(turns, results.history.column("torque_main_Nmm") / 1e4, "--", label="torque of the main roll (10 Nm)")
    middle.set(xlabel="revolutions of the ring", ylim=(0, None))
    angle, wall, height = section(results)
    right.plot(np.rad2deg(angle), wall, label="wall")
    right.plot(np.rad2deg(angle), height, label="height")
    right.set(xlabel="behind the main roll (degrees)", ylabel="mm", ylim=(15, 25), xticks=range(0, 361, 90))
    for axes in (middle, right):
        axes.grid(True, linewidth=0.5, alpha=0.4)
        axes.legend(frameon=False, fontsize="small")
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
