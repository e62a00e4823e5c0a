"""What an elastic die costs: a thin strip between rigid and between elastic dies, in the same steps.

The die has at least four times the unknowns of the strip and is condensed to the nodes that contact reaches: one
factorisation in the whole run. CPU seconds of one process after a warm-up run that compiles the forms, the lesser of two
runs in turn; on another machine their ratio carries over, not they themselves.

    python3 benchmarks/elastic_dies.py
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

import fenics_forming as ff

HERE = Path(__file__).parent
START, TRAVEL, STEPS = 6.0, 1.8, 60      # mm of half the thickness
MOST = 1.5                               # times the run with rigid dies


def press(mode: str, steps: int = STEPS, mesh: float = 0.35, contact: float = 1.0) -> ff.Results:
    """A quarter of a strip of 12 x 37.7 mm pressed by dies that deform in this mode."""
    return ff.simulate(ff.Scene.read({
        "geometry": "plane_strain",
        "materials": {"strip": {"flow_stress": {"law": "constant", "value": 200.0}},
                      "steel": {"young": 210e3, "poisson": 0.3}},
        "workpieces": {"strip": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [18.85, START]}, "material": "strip",
                                 "symmetry": ["x", "y"], "mesh_size": mesh}},
        "tools": {"upper": {"shape": {"kind": "rectangle", "from": [0, START], "to": [250, START + 250]}, "symmetry": ["x"],
                            "material": "steel", "mesh_size": {"contact": contact, "far": 3.8},
                            "held": {"y_high": ["x", "y"]}, "friction": {"law": "siebel", "factor": 0.2},
                            "drive": {"kind": "speed", "velocity": [0, -1]}}},
        "process": {"tool_deformation": mode}, "steps": {"stroke": TRAVEL / steps}, "stop": {"stroke": TRAVEL}}))


def main() -> list[dict]:
    """Run both, write ``elastic_dies.csv``, print the rows."""
    for mode in ("rigid", "iterated"):
        press(mode, mesh=1.0, contact=2.0)
    runs = [(mode, press(mode)) for mode in ("rigid", "iterated") * 2]
    rows = []
    for mode in ("rigid", "iterated"):
        results = min((r for m, r in runs if m == mode), key=lambda r: r.summary["cpu_s"])
        s, iterations = results.summary, results.history.column("newton_iterations")
        rows.append({"dies": mode, "dofs": s["dofs"], "steps": s["steps"], "iterations": s["newton_iterations"],
                     "iterations_per_step_flowing": float(np.mean(iterations[-20:])),
                     "factorisations_of_the_die": s.get("deformation", {}).get("upper", {}).get("factorisations", 0),
                     "unknowns_of_the_die": s.get("deformation", {}).get("upper", {}).get("unknowns", 0),
                     "cpu_s": round(s["cpu_s"], 2)})
    with open(HERE / "elastic_dies.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    for row in rows:
        print(" · ".join(f"{key} {value}" for key, value in row.items()))
    ratio = rows[1]["cpu_s"] / rows[0]["cpu_s"]
    print(f"an elastic die takes {ratio:.2f} times the CPU time of a rigid one, {MOST} is what it may take")
    return rows


if __name__ == "__main__":
    main()
