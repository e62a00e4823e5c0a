"""A spike rises in a conical hole while the billet around it is upset: the die is a file of triangles.

The billet is round, and so is the die; so the same process in the plane, turned about the axis, says what the body in space
must do, with elements so small that they do not matter. The hole has a draft of 8 degrees and a rounded mouth. Most of the
metal flows outwards, as in open-die upsetting, the rest into the hole; how high the spike gets depends on the friction on
both ways. The triangles of the die are made here, by turning its profile, and written to a file as a drawing would be.

    python3 demos/spike_forging_3d.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming import scene as words
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "spike_forging_3d.toml"
# of the die, from its axis outwards: end of the hole, mouth, rim; radii, mm
PROFILE, ROUNDED = ((-1.0, 14.0), (2.6, 14.0), (4.6, 0.0), (30.0, 0.0)), (0.0, 1.0, 1.5, 0.0)
STROKES = (2.0, 4.0, 6.0)


def main(coarse: bool = False, out: str | Path = "results/spike_forging_3d", quiet: bool = False
         ) -> dict[str, ff.Results]:
    """Forge the spike in space and in the plane, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps, half of the stroke, and twice the tolerance
    out : folder for the results and the die
    quiet : print nothing

    Returns
    -------
    "space" and "plane" → results
    """
    out = Path(out)
    die = write_die(out / "die.stl")
    changes = [f"tools.die.shape.path='{die.resolve()}'"]
    if coarse:
        ball = "{kind='sphere', centre=[0, 0, 0], radius=6.5, size=2.0}"
        changes += ["workpieces.billet.mesh_size=3.2", f"workpieces.billet.refine=[{ball}]", "steps.stroke=0.5",
                    "stop.stroke=3"]
    runs = {}
    for name, scene in (("space", ff.read_scene(SCENE, set=changes)), ("plane", turned(coarse))):
        with Progress(total=scene.stop.stroke, quiet=quiet) as progress:
            runs[name] = ff.simulate(scene, out / name, observer=progress)
    picture(runs, Path(out) / "spike.png")
    compare(compared(runs, slack=2.0 if coarse else 1.0), quiet=quiet)
    return runs


def turned(coarse: bool) -> ff.Scene:
    """The same process about the axis, with small elements."""
    table = ff.read_scene(SCENE).as_table()
    size = 1.0 if coarse else 0.6
    billet = {"shape": {"kind": "rectangle", "from": [0, -14], "to": [10, 0]}, "material": "aluminium", "mesh_size": size,
              "refine": [{"kind": "sphere", "centre": [0, 0], "radius": 6.5, "size": 0.5 * size}], "remesh": {}}
    lower = {"kind": "polyline", "points": PROFILE, "fillet": ROUNDED, "side": "right"}
    friction = table["tools"]["die"]["friction"]
    return ff.Scene.read(table | {
        "title": "the same, turned about its axis", "geometry": "axisymmetric", "workpieces": {"billet": billet},
        "tools": {"die": {"shape": lower, "friction": friction},
                  "ram": {"shape": {"kind": "plane", "point": [0, -14], "normal": [0, 1]}, "friction": friction,
                          "drive": {"kind": "speed", "velocity": [0, 1]}}},
        "stop": {"stroke": 3.0 if coarse else table["stop"]["stroke"]}})


def write_die(path: Path, sides: int = 96) -> Path:
    """Turn the profile and write its triangles to a file, their normals towards the billet."""
    outline = words.Polyline(points=PROFILE, fillet=ROUNDED, side="left").boundary_points(1.0)
    r, z = outline[outline[:, 0] >= 0].T
    r, z = np.append(0.0, r), np.append(PROFILE[0][1], z)
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    height = np.broadcast_to(z[:, None], (len(r), sides + 1))
    grid = np.stack([r[:, None] * np.cos(angle), r[:, None] * np.sin(angle), height], axis=2)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    triangles = np.concatenate([np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in ((a, c, b), (a, d, c))])
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    kept = np.linalg.norm(normals, axis=1) > 1e-12
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["solid die"]
    for normal, corners in zip(normals[kept], triangles[kept], strict=True):
        lines += ["facet normal {:.9g} {:.9g} {:.9g}".format(*normal / np.linalg.norm(normal)), "outer loop",
                  *("vertex {:.9g} {:.9g} {:.9g}".format(*corner) for corner in corners), "endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid die", ""]), encoding="ascii")
    return path


def compared(runs: dict[str, ff.Results], slack: float) -> list[Compared]:
    """The body in space beside the turned one, and what any body keeps."""
    space, plane = runs["space"], runs["plane"]
    end = space.stroke()[-1]
    rows = []
    for stroke in (s for s in STROKES if s <= end):
        ours, reference = (run.at(stroke=stroke)["force_ram_N"] / 1e3 for run in (space, plane))
        rows.append(Compared(f"force at {stroke:g} mm, kN", ours, reference, 0.03 * slack, "about the axis"))
    box, turned_box = (run.summary["extents_mm"]["billet"] for run in (space, plane))
    rows.append(Compared("tip of the spike above the mouth, mm", box["z"][1], turned_box["z"][1], 0.05 * slack,
                         "about the axis"))
    rows.append(Compared("largest radius, mm", box["x"][1], turned_box["r"][1], 0.01 * slack, "about the axis"))
    rows.append(Compared("largest y over largest x", box["y"][1] / box["x"][1], 1.0, 0.005 * slack, "symmetry"))
    last, ledger = space.history.rows[-1], space.summary["ledger"]
    rows.append(Compared("force of the die, kN", last["force_die_N"] / 1e3, last["force_ram_N"] / 1e3, 0.01 * slack,
                         "balance"))
    rows.append(Compared("change of volume, 1e-6", 1e6 * ledger["volume"]["worst_relative_error"], 0.0, 100.0 * slack,
                         "constancy", relative=False))
    rows.append(Compared("powers that do not balance at worst, %", 100 * ledger["power"]["worst_relative_imbalance"], 0.0,
                         0.1, "first law", relative=False))
    return rows


def picture(runs: dict[str, ff.Results], path: Path) -> None:
    """The spike in space, the section of the turned body, and the forces."""
    figure, axes = plt.subplots(1, 4, figsize=(15, 4.6), width_ratios=[1.1, 1, 0.2, 0.9], layout="constrained")
    axes[2].axis("off")         # place for the scale of the colours
    axes[0].imshow(ff.plot_fields(runs["space"], "effective_strain", tools=[]))
    axes[0].axis("off")
    ff.plot_fields(runs["plane"], "effective_strain", mesh=False, ax=axes[1])
    for name, style in (("plane", "-"), ("space", "o")):
        axes[3].plot(runs[name].stroke()[1:], runs[name].force()[1:] / 1e3, style, markersize=4, label=f"in {name}")
    axes[3].set(xlabel="stroke (mm)", ylabel="force of the ram (kN)", ylim=(0, None))
    axes[3].grid(True, linewidth=0.5, alpha=0.4)
    axes[3].legend(frameon=False)
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
