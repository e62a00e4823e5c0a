"""A cube of 30 mm is upset by 30 % between dies that it sticks to: how fine must the mesh be?

The metal hardens, 700 + 300 MPa times strain. Where the die ends the stress is singular and the force comes down slowly
with the size of the elements; three meshes, each about half as fine again, show how far it still has to go. What it goes
to is known from either side: by the force of uniform flow without friction from below, and by the upper bound from above,

    F > sigma V / h ,      F <= sigma V/h + (k / 2 h) ∫ r dA,    k = sigma / sqrt(3),  sigma = 700 + 300 ln(H/h),

with half the height h and the distance r from the axis over the face.

The equations in space are solved by iterations: their number hardly depends on the mesh, which the table shows too.

    python3 demos/block_forging_3d.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "block_forging_3d.toml"
HALF = 15.0                     # of the cube, mm
SIZES = (2.5, 2.0, 1.75)        # of the elements, mm
REDUCTIONS = (0.09, 0.18, 0.30)


def main(coarse: bool = False, out: str | Path = "results/block_forging_3d", quiet: bool = False
         ) -> dict[float, ff.Results]:
    """Upset the cube on three meshes, compare, draw.

    Parameters
    ----------
    coarse : larger elements and three times the tolerances
    out : folder for the results
    quiet : print nothing

    Returns
    -------
    size of the elements, mm → results
    """
    sizes = tuple(1.4 * size for size in SIZES) if coarse else SIZES
    runs = {}
    for size in sizes:
        scene = ff.read_scene(SCENE, set=[f"workpieces.block.mesh_size={size}", "solver.linear='iterative'"])
        with Progress(total=scene.stop.stroke, quiet=quiet) as progress:
            runs[size] = ff.simulate(scene, Path(out) / f"h_{size:g}", observer=progress)
    picture(runs, Path(out) / "block_forging.png")
    compare(compared(runs, slack=3.0 if coarse else 1.0), quiet=quiet)
    return runs


def compared(runs: dict[float, ff.Results], slack: float) -> list[Compared]:
    """Forces beside those of the finest mesh and between their bounds; iterations, volume and power."""
    sizes = sorted(runs, reverse=True)
    fine, rows = runs[sizes[-1]], []
    for q in REDUCTIONS:
        finest = fine.at(stroke=q * HALF)["force_upper_N"] / 1e6
        for size, allowed in zip(sizes[:-1], (0.01, 0.005), strict=True):
            ours = runs[size].at(stroke=q * HALF)["force_upper_N"] / 1e6
            rows.append(Compared(f"{100 * q:.0f} %: force with elements of {size:.3g} mm, MN", ours, finest,
                                 allowed * slack, "the finest mesh"))
    stroke, force = fine.stroke()[1:], fine.force()[1:]
    least, most = bounds(stroke)
    solvers = [results.summary["linear_solver"] for results in runs.values()]
    krylov = [solver["krylov iterations"] / solver["solves"] for solver in solvers]
    ledger = fine.summary["ledger"]
    return rows + [
        Compared("force above the upper bound, largest, %", 100 * max((force / most - 1).max(), 0.0), 0.0, 0.1,
                 "upper bound", relative=False),
        Compared("force below that of uniform flow, largest, %", 100 * max((1 - force / least).max(), 0.0), 0.0, 0.1,
                 "no friction", relative=False),
        Compared("iterations of the linear solver, most over fewest", max(krylov) / min(krylov), 1.0, 0.5,
                 "independent of the mesh"),
        Compared("change of volume, 1e-6", 1e6 * ledger["volume"]["worst_relative_error"], 0.0, 1.0, "constancy",
                 relative=False),
        Compared("powers that do not balance at worst, %", 100 * ledger["power"]["worst_relative_imbalance"], 0.0, 0.1,
                 "first law", relative=False)]


def bounds(stroke: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force without friction and upper bound, N, of the whole cube, which stays a box in either."""
    h = HALF - stroke
    sigma, side = 700 + 300 * np.log(HALF / h), np.sqrt(HALF**3 / h)
    # ∫ r dA over a quarter of the face, a square of that side
    moment = side**3 * (np.sqrt(2) + np.arcsinh(1.0)) / 3
    least = 4 * sigma * HALF**3 / h
    return least, least + 4 * sigma / np.sqrt(3) / (2 * h) * moment


def picture(runs: dict[float, ff.Results], path: Path) -> None:
    """The upset block beside the forces and what is left of their error."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(14, 4.4), width_ratios=[1.1, 1, 0.8],
                                                 layout="constrained")
    finest = min(runs)
    left.imshow(ff.plot_fields(runs[finest], "effective_strain"))
    left.axis("off")
    for number, (size, results) in enumerate(runs.items()):
        dofs = results.summary["dofs"]
        middle.plot(100 * results.stroke()[1:] / HALF, results.force()[1:] / 1e6, color=f"C{number}",
                    label=f"{size:.3g} mm, {dofs} unknowns")
    stroke = runs[finest].stroke()[1:]
    for values, name, style in zip(bounds(stroke), ("no friction", "upper bound"), (":", "--"), strict=True):
        middle.plot(100 * stroke / HALF, values / 1e6, style, color="0.5", label=name)
    middle.set(xlabel="reduction of height (%)", ylabel="force of a die (MN)", ylim=(0, 1.6))
    middle.legend(frameon=False, fontsize="small", loc="lower right")
    for number, q in enumerate(REDUCTIONS):
        forces = np.array([results.at(stroke=q * HALF)["force_upper_N"] for results in runs.values()])
        right.plot(list(runs), 100 * (forces / forces[-1] - 1), "o-", color=f"C{number + 3}", label=f"at {100 * q:.0f} %")
    right.set(xlabel="size of the elements (mm)", ylabel="force above that of the finest mesh (%)")
    right.legend(frameon=False, fontsize="small")
    for axes in (middle, right):
        axes.grid(True, linewidth=0.5, alpha=0.4)
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
