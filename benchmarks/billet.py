"""Run time against error: the billet of the demo on three meshes with three steps, and a block in space.

Every error is taken against a finer run made here, so that it shows mesh and step alone; the billet is also compared
with the converged rigid-plastic values of the demo. Times are CPU seconds of one process after a warm-up run that
compiles the forms; on another machine their ratios carry over, not they themselves.

    python3 benchmarks/billet.py
"""

from __future__ import annotations

import csv
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator

import fenics_forming as ff
from demos.billet_upsetting import HEIGHT, RIGID_PLASTIC, SCENE

HERE = Path(__file__).parent
MESHES, STEPS, FINEST = (1.5, 1.0, 0.7), (0.9, 0.45, 0.225), (0.5, 0.1125)
STROKES = [q * HEIGHT for q in RIGID_PLASTIC]
BLOCK_MESHES, BLOCK_FINEST = (2.6, 2.2, 1.9), 1.5


def upset_billet(mesh: float, step: float, scheme: str = "midpoint") -> ff.Results:
    """The scene of the demo with another mesh, step (both mm) and scheme."""
    return ff.simulate(ff.read_scene(SCENE, set=[
        f"workpieces.billet.mesh_size={mesh}", f"steps.stroke={step}", f"steps.scheme={scheme}",
        f"output.strokes={STROKES}"]))


def upset_block(mesh: float) -> ff.Results:
    """One eighth of a 30 mm cube between sticking plates, by 10 % in three steps."""
    return ff.simulate(ff.Scene(
        geometry="3d",
        materials={"steel": {"flow_stress": {"law": "linear", "initial": "700 MPa", "hardening": "300 MPa"}}},
        workpieces={"cube": {"shape": {"kind": "box", "from": [0, 0, 0], "to": [15, 15, 15]}, "material": "steel",
                             "symmetry": ["x", "y", "z"], "mesh_size": mesh}},
        tools={"upper": {"shape": {"kind": "plane", "point": [0, 0, 15], "normal": [0, 0, -1]},
                         "drive": {"kind": "speed", "velocity": [0, 0, "-1 mm/s"]}, "friction": {"law": "sticking"}}},
        steps={"stroke": 0.5}, stop={"stroke": 1.5}))


def forces(results: ff.Results) -> np.ndarray:
    """Force at 10, 20 … 60 %, kN."""
    return np.array([results.at(stroke=s)["force_upper_N"] for s in STROKES]) / 1e3


def measured(results: ff.Results) -> dict:
    """What every row of a table says about cost."""
    s = results.summary
    return {"dofs": s["dofs"], "steps": s["steps"], "solves": s["solves"],
            "iterations_per_solve": round(s["newton_iterations_per_solve"], 2), "cpu_s": round(s["cpu_s"], 2),
            "share_outside_assembly_and_solve": round(s["share_outside_assembly_and_solve"], 3)}


def billet_rows() -> list[dict]:
    """Cost and error of every run of the billet; of a run that failed only what it was."""
    finest = upset_billet(*FINEST)
    best, reference = forces(finest), np.array([force for force, _ in RIGID_PLASTIC.values()])
    cases = [*product(["midpoint"], MESHES, STEPS), *product(["explicit", "etd2"], MESHES[1:2], STEPS)]
    rows = []
    for scheme, mesh, step in [*cases, ("midpoint", *FINEST)]:
        try:
            results = finest if (mesh, step) == FINEST else upset_billet(mesh, step, scheme)
        except ff.ConvergenceError:
            rows.append({"scheme": scheme, "mesh_mm": mesh, "step_mm": step})
            continue
        found = forces(results)
        rows.append({"scheme": scheme, "mesh_mm": mesh, "step_mm": step, **measured(results),
                     "force_error_to_finest": round(float(np.abs(found / best - 1).max()), 5),
                     "force_error_to_reference": round(float(np.abs(found / reference - 1).max()), 5),
                     "radius_mm": round(results.at(stroke=STROKES[-1])["equator_r_mm"], 4),
                     "volume_error": float(f"{results.history.column('volume_error_billet')[-1]:.1e}")})
    return rows


def block_rows() -> list[dict]:
    """Cost and error of every run of the block."""
    finest = upset_block(BLOCK_FINEST)
    rows = []
    for mesh, results in [*((h, upset_block(h)) for h in BLOCK_MESHES), (BLOCK_FINEST, finest)]:
        error = np.abs(results.force() / finest.force() - 1).max()
        rows.append({"mesh_mm": mesh, "cells": results.summary["cells"], **measured(results),
                     "force_error_to_finest": round(float(error), 5)})
    return rows


# ---------------------------------------------------------------------- tables and picture
def write_csv(rows: list[dict], path: Path) -> None:
    """The rows as they are."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, rows[-1].keys(), restval="failed", lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def markdown(rows: list[dict], columns: dict) -> str:
    """A table with ``columns``: head → f(row) → text; "failed" where a row has no such number."""
    def shown(text, row):
        try:
            return str(text(row))
        except KeyError:
            return "failed"

    lines = [list(columns), ["---:"] * len(columns), *([shown(t, row) for t in columns.values()] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def draw(rows: list[dict], path: Path) -> None:
    """Error against time, both logarithmic: a line per mesh of the midpoint scheme and per other scheme."""
    figure, ax = plt.subplots(figsize=(7.6, 4.4), layout="constrained")
    runs = [row for row in rows if row.get("force_error_to_finest", 0) > 0]
    for scheme, mesh in dict.fromkeys((row["scheme"], row["mesh_mm"]) for row in runs):
        line = [row for row in runs if (row["scheme"], row["mesh_mm"]) == (scheme, mesh)]
        ax.loglog([row["cpu_s"] for row in line], [100 * row["force_error_to_finest"] for row in line],
                  "o-" if scheme == "midpoint" else "s--", label=f"{scheme}, {mesh:g} mm")
    ax.set(xlabel="CPU time (s)", ylabel="largest error of the force at 10 … 60 % (%)",
           title="Billet: on each line the steps are 0.9, 0.45, 0.225 mm")
    ax.title.set_fontsize("medium")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    ax.grid(True, which="both", linewidth=0.5, alpha=0.4)
    ax.legend(frameon=False, fontsize="small", loc="upper left", bbox_to_anchor=(1, 1))
    figure.savefig(path, dpi=90)
    plt.close(figure)


def percent(key: str, digits: int = 2):
    """Text of a relative number as a percentage."""
    return lambda row: f"{100 * row[key]:.{digits}f} %"


def main() -> str:
    """Run everything, write ``billet.csv``, ``block.csv`` and ``billet.png``; the Markdown of both tables."""
    upset_billet(3.0, 4.5)
    upset_block(15.0)
    billet, block = billet_rows(), block_rows()
    write_csv(billet, HERE / "billet.csv")
    write_csv(block, HERE / "block.csv")
    draw(billet, HERE / "billet.png")
    unit = min(row["cpu_s"] for row in billet if "cpu_s" in row)
    mesh = {"mesh mm": lambda r: f"{r['mesh_mm']:g}"}
    cost = {"dofs": lambda r: r["dofs"], "steps": lambda r: r["steps"],
            "iterations a solve": lambda r: f"{r['iterations_per_solve']:.1f}", "CPU s": lambda r: f"{r['cpu_s']:.2f}"}
    rest = {"outside assembly and solve": percent("share_outside_assembly_and_solve", 0)}
    error = {"force, to the finest": percent("force_error_to_finest")}
    return "\n\n".join([
        "### Billet, 60 % (axisymmetric)",
        markdown(billet, {
            "scheme": lambda r: r["scheme"], **mesh, "step mm": lambda r: f"{r['step_mm']:g}", **cost,
            "ratio": lambda r: f"{r['cpu_s'] / unit:.1f}", **error,
            "force, to the reference": percent("force_error_to_reference"),
            "radius mm": lambda r: f"{r['radius_mm']:.3f}", "volume": lambda r: f"{r['volume_error']:+.0e}", **rest}),
        "![error against time](billet.png)",
        "### Block in space, 10 % in three steps (one eighth of a cube, sticking plates)",
        markdown(block, {**mesh, "cells": lambda r: r["cells"], **cost, **error, **rest})])


if __name__ == "__main__":
    print(main())
