"""A hot billet of steel is upset on a crank press; the upper die takes its heat in each of the four ways there are.

``none`` insulates, ``constant`` keeps the die at 250 °C whatever it is given, ``column`` lets every point of the surface
warm a column of die below it, and ``coupled`` computes the temperatures in the die on a mesh of its own. The last two must
agree: in a twelfth of a second heat goes a millimetre deep, which is so little beside the billet that neighbouring columns
do not notice one another. In the first moments of contact billet and die are two half spaces, with a closed solution,

    q = h (T1 - T2) exp(g² t) erfc(g √t),   g = h (1 / e1 + 1 / e2),   e² = conductivity · density · specific heat.

    python3 demos/hot_forging.py
"""

from __future__ import annotations

from math import pi
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import erfcx

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.laws.heat_exchange import effusivity
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "hot_forging.toml"
KINDS = ("none", "constant", "column", "coupled")
COLOURS = dict(zip(KINDS, ("tab:gray", "tab:blue", "tab:orange", "tab:red"), strict=True))
EARLY = 2.0       # mm of stroke, 4 ms: until then the surface of contact has hardly grown
LATE = 24.0       # mm of stroke: a little before the dead centre, where the press comes to rest


def main(coarse: bool = False, out: str | Path = "results/hot_forging", quiet: bool = False) -> dict[str, ff.Results]:
    """Forge the billet four times; compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps
    out : folder for the results
    quiet : print nothing
    """
    changes = ["workpieces.billet.mesh_size='5 mm'", "steps.stroke='2 mm'"] if coarse else []
    scene = ff.read_scene(SCENE, set=changes)
    runs = {}
    for kind in KINDS:
        with Progress(total=25.0, quiet=quiet) as progress:
            runs[kind] = ff.simulate(with_die(scene, kind, coarse), Path(out) / kind, observer=progress)
    picture(runs, Path(out) / "hot_forging.png")
    compare(compared(runs, early=0.08 if coarse else 0.04), quiet=quiet)
    return runs


def with_die(scene, kind: str, coarse: bool):
    """The scene with an upper die of this kind, and elements at the dies that are as fine as heat goes deep."""
    die, billet = scene.tools["upper"], scene.workpieces["billet"]
    given = {"none": {}, "constant": {"temperature": 250, "coefficient": 10}}.get(
        kind, {"temperature": 250, "coefficient": 10, "material": "die"})
    fine = 1.0 if coarse else 0.4
    domains = [{"kind": "near_tool", "tool": name, "distance": 1, "size": fine} for name in scene.tools]
    block = {"kind": "rectangle", "from": [0, 60], "to": [45, 90]}
    upper = die.replaced(shape=block, material="die", mesh_size={"contact": 0.25, "far": 8},
                         heat_exchange={"kind": kind, **given})
    return scene.replaced(title=f"{scene.title}, die: {kind}", tools={**scene.tools, "upper": upper},
                          workpieces={"billet": billet.replaced(refine=domains)},
                          points={"face": {"body": "billet", "at": [0, 60]}},
                          output={"strokes": [EARLY, LATE], "fields_every": 10, "checkpoint_every": 0})


def half_spaces(scene, times: np.ndarray, areas: np.ndarray) -> float:
    """Heat, J, that one half space has given the other through a surface that grows (areas (n,) mm² at times (n,) s)."""
    steel, die = (effusivity(scene.materials[name]) for name in ("steel", "die"))
    h, g = 10.0, 10.0 * (1 / steel + 1 / die)
    return float(np.trapezoid(h * 900.0 * erfcx(g * np.sqrt(times)) * areas, times)) / 1000


def compared(runs: dict[str, ff.Results], early: float) -> list[Compared]:
    """The two kinds that must agree, the first moments beside half spaces (tolerance ``early``), the balance of heat."""
    column, coupled = runs["column"], runs["coupled"]
    rows = [Compared(what, column.at(stroke=LATE)[name], coupled.at(stroke=LATE)[name], 0.02, "coupled")
            for what, name in (("column: force at 24 mm, N", "force_upper_N"),
                               ("column: heat given to the die, J", "heat_to_upper_J"),
                               ("column: face of the billet on the axis, °C", "face_temperature_degC"),
                               ("column: hottest place of the die, °C", "max_temperature_upper_degC"))]
    first = column.history.column("stroke_upper_mm") <= EARLY + 1e-6
    times, stroke = (column.history.column(name)[first] for name in ("time_s", "stroke_upper_mm"))
    closed = half_spaces(column.scene, times, pi * 20**2 * 60 / (60 - stroke))
    rows += [Compared(f"{kind}: heat in the first {1000 * times[-1]:.1f} ms, J",
                      runs[kind].at(stroke=EARLY)["heat_to_upper_J"], closed, early, "two half spaces")
             for kind in ("column", "coupled")]
    worst = max(float(np.abs(run.history.column("heat_imbalance")).max()) for run in runs.values())
    rows.append(Compared("heat that is not accounted for, of any step", worst, 0.0, 1e-8, "balance", relative=False))
    return rows


def picture(runs: dict[str, ff.Results], path: Path) -> None:
    """Temperatures in billet and die near their face; those of both faces, and the heat that went over, by the stroke."""
    figure, (field, faces, heat) = plt.subplots(1, 3, figsize=(15, 4.4), layout="constrained",
                                                gridspec_kw={"width_ratios": [1.7, 1, 1]})
    draw_field(field, figure, runs["coupled"])
    for kind, run in runs.items():
        stroke, look = run.stroke("upper"), {"color": COLOURS[kind], "linewidth": 4 if kind == "column" else 1.5}
        faces.plot(stroke, run.history.column("face_temperature_degC"), label=kind, **look)
        if "max_temperature_upper_degC" in run.history.columns:
            faces.plot(stroke, run.history.column("max_temperature_upper_degC"), "--", **look)
        given = run.history.column("heat_to_upper_J") if kind != "none" else np.zeros(len(stroke))
        heat.plot(stroke, given, label=kind, **look)
    faces.axhline(250, linestyle="--", linewidth=1, color=COLOURS["constant"])
    faces.set(xlabel="stroke, mm", ylabel="temperature, °C",
              title="face of the billet on the axis (full),\nhottest place of the die (dashed)")
    heat.set(xlabel="stroke, mm", ylabel="heat, J", title="heat given to the upper die")
    faces.legend(title="upper die", loc="center right")
    heat.legend(title="upper die")
    for axes in (faces, heat):
        axes.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def draw_field(axes, figure, run: ff.Results) -> None:
    """The section of billet and upper die at the last frame before the dead centre, each on a scale of its own."""
    import meshio

    from fenics_forming.results.recording.fields import read_frames
    frames = {series: {round(time, 9): path for time, path in read_frames(run.folder, series)}
              for series in ("fields", "heat_upper")}
    time = sorted(set(frames["fields"]) & set(frames["heat_upper"]))[-2]
    for series, colours, low, high, what in (("fields", "inferno", 900, 1170, "billet"),
                                             ("heat_upper", "viridis", 250, 450, "die")):
        mesh = meshio.read(frames[series][time])
        x, cells = mesh.points, mesh.cells[0].data[:, :3]
        for side in (1, -1):
            drawn = axes.tripcolor(side * x[:, 0], x[:, 1], cells, mesh.point_data["temperature_degC"],
                                   shading="gouraud", vmin=low, vmax=high, cmap=colours)
        figure.colorbar(drawn, ax=axes, label=f"{what}, °C", shrink=0.75, aspect=25, pad=0.02)
    axes.set(aspect="equal", xlim=(-32, 32), ylim=(8, 44), xlabel="r, mm", ylabel="z, mm",
             title="temperatures at the face, coupled die")


if __name__ == "__main__":
    main()
