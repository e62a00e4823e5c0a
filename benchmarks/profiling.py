"""Where the time of a run goes: the billet of the demo in 20 midpoint steps on four meshes; how long a first step takes.

Shares of one run, of one process; a run on the coarsest mesh before compiles the forms. What was tried to make them
smaller, and what it gave, is in ``PROFILE.md``.

    python3 benchmarks/profiling.py
"""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import fenics_forming as ff
from demos.billet_upsetting import HEIGHT, SCENE

HERE = Path(__file__).parent
MESHES, STEPS = (1.3, 1.0, 0.7, 0.28), 20
START = """
from time import process_time
start = process_time()
import fenics_forming as ff
imported = process_time() - start
ff.simulate(ff.read_scene({scene!r}, set=["stop.stroke='0.01 mm'", "steps.stroke='0.01 mm'"]))
print(imported, process_time() - start)
"""


def profile(mesh: float, steps: int = STEPS) -> dict:
    """Unknowns, triangles and CPU seconds of a run, and the shares of its parts."""
    results = ff.simulate(ff.read_scene(SCENE, set=[f"workpieces.billet.mesh_size={mesh}",
                                                    f"steps.stroke={0.6 * HEIGHT / steps}"]))
    s = results.summary
    shares = {f"{part.replace(' ', '_')}_share": round(seconds / s["wall_s"], 3)
              for part, seconds in s["wall_s_by_part"].items()}
    return {"mesh_mm": mesh, "dofs": s["dofs"], "cells": s["cells"], "steps": s["steps"],
            "iterations_per_solve": round(s["newton_iterations_per_solve"], 2), "cpu_s": round(s["cpu_s"], 2), **shares,
            "outside_assembly_and_solve": round(s["share_outside_assembly_and_solve"], 3)}


def start_up() -> tuple[float, float]:
    """CPU seconds until the package is imported, and to the end of a first, short step; new process, forms compiled."""
    done = subprocess.run([sys.executable, "-c", START.format(scene=str(SCENE))], check=True, capture_output=True,
                          text=True)
    imported, first = map(float, done.stdout.split())
    return imported, first


def main() -> None:
    """Write ``profile.csv``; print it and the times of the start."""
    profile(3.0, 4)
    rows = [profile(mesh) for mesh in MESHES]
    with (HERE / "profile.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, rows[-1].keys(), restval=0.0, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    print((HERE / "profile.csv").read_text(encoding="utf-8"))
    start_up()
    print("import {:.2f} s, first step {:.2f} s".format(*start_up()))


if __name__ == "__main__":
    main()
