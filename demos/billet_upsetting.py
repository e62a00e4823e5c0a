"""A steel billet, 30 mm long and 20 mm thick, is upset by 60 % between rough flat dies.

The dies hold whatever touches them, so the side of the billet bulges and folds onto them. The process is a classic
test of forming codes: Lippmann (ed.), *Metal Forming Plasticity*, Springer 1979; Taylor, 1981; and "Upsetting of a
cylindrical billet" in the Abaqus Example Problems. Those show curves only, so the numbers below were computed for this
project: by an explicit elastic-plastic code of its own kind, checked against CalculiX up to 20 %, and, without
elasticity, by a prototype of the present method, refined until mesh and step no longer mattered.

    python3 demos/billet_upsetting.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

import fenics_forming as ff
from demos.comparison import Compared, compare
from fenics_forming.results import Progress

SCENE = Path(__file__).parent / "scenes" / "billet_upsetting.toml"
HEIGHT = 15.0      # of the upper half, mm; a reduction of 60 % is a stroke of 9 mm

# reduction: (force in kN, half the width of its band), die force on the whole billet; at 50 and 60 % between the values of
# docs/REFERENCES.md (588, 865) and the mean of twelve finer runs of this package (585, 864)
RIGID_PLASTIC = {0.1: (261.6, 0), 0.2: (307.5, 0), 0.3: (366, 0), 0.4: (450, 0), 0.5: (586, 2), 0.6: (864, 3)}
ELASTIC_PLASTIC = {0.1: (261, 1), 0.2: (306, 1), 0.3: (364, 3), 0.4: (448, 5), 0.5: (582, 6), 0.6: (854, 15)}
RADIUS = {"rigid-plastic": (16.54, 0), "elastic-plastic": (16.51, 0.02)}      # of the equator at 60 %, mm


def main(coarse: bool = False, out: str | Path = "results/billet_upsetting", quiet: bool = False) -> ff.Results:
    """Upset the billet, compare, draw.

    Parameters
    ----------
    coarse : larger elements and steps, and 4 % instead of 1 % of tolerance
    out : folder for the results
    quiet : print nothing
    """
    changes = ["workpieces.billet.mesh_size='1.5 mm'", "steps.stroke='0.5 mm'"] if coarse else []
    scene = ff.read_scene(SCENE, set=changes)
    with Progress(total=scene.stop.stroke, quiet=quiet) as progress:
        results = ff.simulate(scene, out, observer=progress)
    picture(results, Path(out) / "billet.png")
    compare(compared(results, tolerance=0.04 if coarse else 0.01), quiet=quiet)
    return results


def compared(results: ff.Results, tolerance: float) -> list[Compared]:
    """Force and radius beside both references: ``tolerance`` is added to the band of each."""
    rows = []
    for source, force in (("rigid-plastic", RIGID_PLASTIC), ("elastic-plastic", ELASTIC_PLASTIC)):
        for reduction, (value, band) in force.items():
            ours = results.at(stroke=reduction * HEIGHT)["force_upper_N"] / 1e3
            rows.append(Compared(f"force at {100 * reduction:.0f} %, kN", ours, value, tolerance + band / value,
                                 f"{source}, converged"))
        radius, band = RADIUS[source]
        rows.append(Compared("equator radius at 60 %, mm", results.at(stroke=0.6 * HEIGHT)["equator_r_mm"], radius,
                             tolerance + band / radius, f"{source}, converged"))
    return rows


def picture(results: ff.Results, path: Path) -> None:
    """The deformed section beside the force over the stroke, with the reference values on it."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.2), width_ratios=[1.25, 1], layout="constrained")
    ff.plot_fields(results, "effective_strain", ax=left)
    left.set_title("after a stroke of 9 mm of each die (60 %)", fontsize="medium")
    ff.plot_force_stroke(results, ax=right)
    line = right.get_lines()[0]
    line.set(marker="", label="fenics_forming")
    strokes = [q * HEIGHT for q in RIGID_PLASTIC]
    forces, bands = zip(*ELASTIC_PLASTIC.values(), strict=True)
    right.errorbar(strokes, forces, bands, fmt="s", color="C1", markersize=5, markerfacecolor="none", capsize=3,
                   label="elastic-plastic reference, its band")
    right.plot(strokes, [f for f, _ in RIGID_PLASTIC.values()], "k+", markersize=9, label="rigid-plastic reference")
    right.legend(frameon=False, fontsize="small")
    right.set(title="", xlabel="stroke of each die (mm)", ylabel="force of a die (kN)", ylim=(0, 950))
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
