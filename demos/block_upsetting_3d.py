"""A rectangular block, 20 x 30 x 20 mm, is upset by 60 % between flat dies; its mesh is renewed whenever it is worn out.

Between smooth dies the block stays a block: force and widths are exact, whatever is done to the mesh. Rough dies hold the
faces back. Material takes the shortest way out, so the narrow side grows more than the long one, the plan of the block
rounds off, and its sides roll over onto the dies. There the mesh wears out first.

The reference for the rough dies is this program with elements of 1.5 mm, ``compress(0.6, mesh_size=1.5, ...)``; an upper
bound that holds for any mesh is the force of uniform flow,

    F <= sigma_0 V/h + (m k / 2 h) ∫ r dA,    k = sigma_0 / sqrt(3),

with half the height h and the distance r from the axis, here over the whole rectangle around the block.

    python3 demos/block_upsetting_3d.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "block_upsetting_3d.toml"
WIDTHS, HEIGHT = (10.0, 15.0), 10.0         # half of each, mm
YIELD = 100.0                               # MPa
ROUGH = 0.6
REDUCTIONS = (0.18, 0.39, 0.6)
FORCE = {0.18: 79.69, 0.39: 116.66, 0.6: 214.2}         # kN, rough dies, at reductions
SPREAD = (19.37, 22.95)                     # mm, half widths in the middle of the height after 60 %


def main(coarse: bool = False, out: str | Path = "results/block_upsetting_3d", quiet: bool = False
         ) -> dict[float, ff.Results]:
    """Upset the block between smooth and between rough dies, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps, 5 % instead of 3 % of tolerance
    out : folder for the results
    quiet : print nothing

    Returns
    -------
    friction factor → results
    """
    size = 3.5 if coarse else None
    runs = {m: compress(m, Path(out) / f"m_{m:g}", mesh_size=size, stroke=0.6 if coarse else None, quiet=quiet)
            for m in (0.0, ROUGH)}
    picture(runs, Path(out) / "block.png")
    compare([*exact(runs[0.0]), *rough(runs[ROUGH], 0.05 if coarse else 0.03), *kept(runs, 2.5 if coarse else 1.5)],
            quiet=quiet)
    return runs


def compress(m: float, out: Path, *, mesh_size: float | None = None, stroke: float | None = None, quiet: bool = False
             ) -> ff.Results:
    """The block between dies with friction factor m; the mesh of uniform flow is renewed although it never wears out."""
    changes = [f"output.strokes={[q * HEIGHT for q in REDUCTIONS]}"]
    changes += [f"tools.upper.friction={{law='siebel', factor={m}}}"] if m else \
        ["tools.upper.friction={law='none'}", "workpieces.block.remesh={every=5}"]
    changes += [f"workpieces.block.mesh_size={mesh_size}"] if mesh_size else []
    changes += [f"steps.stroke={stroke}"] if stroke else []
    scene = ff.read_scene(SCENE, set=changes)
    with Progress(total=scene.stop.stroke, quiet=quiet) as progress:
        return ff.simulate(scene, out, observer=progress)


def exact(results: ff.Results) -> list[Compared]:
    """Uniform flow: F = sigma_0 A H / h for the whole block, the half widths grow by (H/h)^(1/2)."""
    rows = []
    for q in REDUCTIONS:
        row = results.at(stroke=q * HEIGHT)
        force = YIELD * 4 * np.prod(WIDTHS) / (1 - q) / 1e3
        rows.append(Compared(f"smooth, {100 * q:.0f} %: force, kN", row["force_upper_N"] / 1e3, force, 1e-3, "exact"))
        for name, width in zip(("narrow_side_x_mm", "long_side_y_mm"), WIDTHS, strict=True):
            rows.append(Compared(f"smooth, {100 * q:.0f} %: half width {name[-4]}, mm", row[name], width / (1 - q) ** 0.5,
                                 1e-3, "exact"))
    return rows


def rough(results: ff.Results, tolerance: float) -> list[Compared]:
    """Forces and widths between rough dies beside those of the fine mesh, and the force below the bound of uniform flow."""
    rows = [Compared(f"rough, {100 * q:.0f} %: force, kN", results.at(stroke=q * HEIGHT)["force_upper_N"] / 1e3, force,
                     tolerance, "fine mesh") for q, force in FORCE.items()]
    last = results.at(stroke=0.6 * HEIGHT)
    for name, width in zip(("narrow_side_x_mm", "long_side_y_mm"), SPREAD, strict=True):
        rows.append(Compared(f"rough, 60 %: half width {name[-4]}, mm", last[name], width, tolerance, "fine mesh"))
    over = np.max(results.force()[1:] / bound(results)[1:] - 1)
    return [*rows, Compared("rough: force above the upper bound, largest, %", 100 * max(over, 0.0), 0.0, 0.1, "upper bound",
                            relative=False)]


def bound(results: ff.Results) -> np.ndarray:
    """Upper bound of the force at every step, N: uniform flow, friction over the rectangle around the block."""
    h = HEIGHT - results.stroke()
    a, b = (results.history.column(name) for name in ("narrow_side_x_mm", "long_side_y_mm"))
    d = np.hypot(a, b)
    # ∫ r dA over a quarter, half widths a and b
    moment = (a * b * d + 0.5 * a**3 * np.arcsinh(b / a) + 0.5 * b**3 * np.arcsinh(a / b)) / 3
    volume = np.prod(WIDTHS) * HEIGHT
    return 4 * (YIELD * volume / h + ROUGH * YIELD / np.sqrt(3) / (2 * h) * moment)


def kept(runs: dict[float, ff.Results], jump: float) -> list[Compared]:
    """What a renewed mesh must not change: the force (``jump``: percent that the coarse rim of the contact costs), the
    volume."""
    rows = []
    for m, results in runs.items():
        summary, name = results.summary, "rough" if m else "smooth"
        jumps = [abs(after[0] / before[0] - 1) for before, after in (r["forces"] for r in summary["remeshed"])]
        rows.append(Compared(f"{name}: largest jump of the force at {len(jumps)} new meshes, %", 100 * max(jumps), 0.0,
                             jump if m else 0.1, "no jump", relative=False))
        rows.append(Compared(f"{name}: change of volume, 1e-6", 1e6 * summary["ledger"]["volume"]["worst_relative_error"],
                             0.0, 1.0, "exact", relative=False))
    return rows


def picture(runs: dict[float, ff.Results], path: Path) -> None:
    """The block after 60 % between rough dies beside the forces, with the references on them."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.6), width_ratios=[1.15, 1], layout="constrained")
    left.imshow(ff.plot_fields(runs[ROUGH], "effective_strain"))
    left.axis("off")
    for number, (m, results) in enumerate(runs.items()):
        right.plot(100 * results.stroke() / HEIGHT, results.force() / 1e3, color=f"C{number}", label=f"m = {m:g}")
        for record in results.summary["remeshed"]:
            right.axvline(100 * record["time"] / HEIGHT, color=f"C{number}", linewidth=0.6, linestyle=":")
    q = np.linspace(0, 0.6, 13)
    right.plot(100 * q, 0.1 * 4 * np.prod(WIDTHS) / (1 - q), "k+", label="exact, m = 0")
    right.plot([100 * q for q in FORCE], list(FORCE.values()), "s", color="C1", markerfacecolor="none", label="fine mesh")
    right.plot(100 * runs[ROUGH].stroke() / HEIGHT, bound(runs[ROUGH]) / 1e3, "--", color="0.5",
               label=f"upper bound, m = {ROUGH:g}")
    right.set(xlabel="reduction of height (%); dotted: a new mesh", ylabel="force of a die (kN)", ylim=(0, None))
    right.grid(True, linewidth=0.5, alpha=0.4)
    right.legend(frameon=False, fontsize="small")
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
