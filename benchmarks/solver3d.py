"""How the cost of a body in space grows: iterations, CPU time and memory of cold and warm solves, and stress tests.

A cube of 15 mm (an eighth of 30 mm) in regular tetrahedra, 700 MPa, between a platen (sticking, Siebel 0.3) or under a ball
of radius 12 mm, which it meets obliquely. A cold solve starts from nothing, a warm one from the step before, 1 % of the
height earlier. Memory is the peak of the process less what the imports take. One case is run by itself in a process:

    python3 benchmarks/solver3d.py                  everything, into solver3d.csv
    python3 benchmarks/solver3d.py punch 16         one case, one line
"""

from __future__ import annotations

import csv
import json
import resource
import subprocess
import sys
from pathlib import Path
from time import process_time

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

import fenics_forming as ff
from fenics_forming.physics.meshing import order_two
from fenics_forming.physics.tools import known_tools
from fenics_forming.process.placing import flowing_body
from fenics_forming.process.tools.machines import drives_of

HERE = Path(__file__).parent
SIZE, SPEED, STEP = 15.0, 1.0, 0.15
FRICTION = {"stick": {"law": "sticking"}, "rough": {"law": "siebel", "factor": 1.0},
            "siebel": {"law": "siebel", "factor": 0.3}, "punch": {"law": "siebel", "factor": 0.3}}
GROWTH = (8, 12, 16, 20, 23)     # cells along an edge: 15 468 to 325 293 unknowns
# name: tool, cells along an edge, height, solver. In rigid zones the viscosity is 1/regularisation times that elsewhere.
STRESS = {"regularisation 1e-6": ("siebel", 8, SIZE, {"regularisation": 1e-6}),
          "ball, regularisation 1e-6": ("punch", 8, SIZE, {"regularisation": 1e-6}),
          "friction m = 1": ("rough", 8, SIZE, {}), "cells 10:1, flat": ("siebel", 8, 1.5, {}),
          "cells 1:10, tall": ("siebel", 8, 150.0, {}),
          **{f"ball, penalty factor {f:g}": ("punch", 8, SIZE, {"penalty_factor": f}) for f in (0.1, 1.0, 100.0, 1000.0)}}


def scene(kind: str, height: float, solver: dict) -> ff.Scene:
    """The cube under its tool."""
    ball = {"kind": "sphere", "centre": [0, 0, height + 12], "radius": 12}
    plane = {"kind": "plane", "point": [0, 0, height], "normal": [0, 0, -1]}
    return ff.Scene.read({
        "geometry": "3d", "materials": {"m": {"flow_stress": {"law": "constant", "value": 700}}},
        "workpieces": {"b": {"shape": {"kind": "box", "from": [0, 0, 0], "to": [SIZE, SIZE, height]}, "material": "m",
                             "symmetry": ["x", "y", "z"], "mesh_size": 1.0}},
        "tools": {"t": {"shape": ball if kind == "punch" else plane, "friction": FRICTION[kind],
                        "drive": {"kind": "speed", "velocity": [0, 0, -SPEED]}}},
        "steps": {"stroke": STEP}, "stop": {"stroke": 1.0}, "solver": {"linear": "iterative"} | solver})


def body_of(described: ff.Scene, cells: int, height: float):
    """A body of regular tetrahedra between the tools of the scene."""
    box = dmesh.create_box(MPI.COMM_WORLD, [[0, 0, 0], [SIZE, SIZE, height]], [cells] * 3)
    tools, drives = known_tools(described), drives_of(described)
    for tool in tools:
        tool.drive = drives.get(tool.name)
    return flowing_body(described, order_two(box), tools, {0: 0.0, 1: 0.0, 2: 0.0})


def case(kind: str, cells: int, height: float, solver: dict) -> dict:
    """Iterations, CPU seconds and memory of cold and warm solves of one body."""
    warm_up = body_of(scene(kind, height, {}), 2, height)       # compiles, and reads what was compiled
    warm_up.is_pushed = lambda dt: True
    warm_up.solve(0.0, warm_up.new_history(), STEP)
    at_start = peak()
    body = body_of(scene(kind, height, solver), cells, height)
    body.is_pushed = lambda dt: True        # the ball touches in one point, which is a corner of the mesh
    history, step, counts = body.new_history(), STEP * height / SIZE, body.solver.system.counts
    body.place(0.0)
    for number in range(4 if kind == "punch" else 0):   # until the ball has a contact worth the name
        body.solve(number * step, history, step, ahead=0.5)
        body.x[:] += step * body.workpiece.velocity
        body.place((number + 1) * step)
    time = step * (4 if kind == "punch" else 0)
    body.workpiece.is_cold = True
    row = {"case": kind, "unknowns": body.workpiece.space.dofmap.index_map.size_global}
    for name in ("cold", "warm"):
        before, began = counts.copy(), process_time()
        flow = body.solve(time, history, step, ahead=0.5)
        spent, krylov = process_time() - began, counts["krylov iterations"] - before["krylov iterations"]
        row |= {f"{name}_newton": flow.iterations, f"{name}_krylov": krylov, f"{name}_cpu_s": round(spent, 2),
                f"{name}_ms_per_newton_and_1000": round(1e6 * spent / flow.iterations / row["unknowns"], 2),
                f"{name}_directly": counts["solved directly"] - before["solved directly"]}
        time += step
        body.x[:] += step * body.workpiece.velocity
        body.place(time)
    row["force_N"] = round(float(-body.contact.forces()[0][2]), 2)
    return row | {"kB_per_unknown": round((peak() - at_start) / row["unknowns"], 2)}


def peak() -> float:
    """Peak memory of this process, kB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def alone(*words) -> dict:
    """A case in a process of its own, so that its peak memory is its own."""
    done = subprocess.run([sys.executable, __file__, *map(str, words)], capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    return json.loads(lines[-1]) if lines else {"case": words[0], "failed": done.stderr.strip().splitlines()[-1][:120]}


def exponent(rows: list[dict], column: str) -> float:
    """Exponent of a column in the number of unknowns, by least squares of the logarithms."""
    x, y = (np.log([float(row[name]) for row in rows]) for name in ("unknowns", column))
    return float(np.polyfit(x, y, 1)[0])


def main() -> list[dict]:
    """All cases, into ``solver3d.csv``; growth and ratios are printed."""
    rows = []
    for kind in ("siebel", "stick", "punch"):
        grown = [alone(kind, n) for n in GROWTH]
        rows += [{"what": "growth"} | row for row in grown]
        print(kind, "exponent of the CPU time per Newton iteration, cold:",
              f"{exponent([r | {'c': r['cold_cpu_s'] / r['cold_newton']} for r in grown], 'c'):.2f}", flush=True)
    for name, (kind, cells, height, solver) in STRESS.items():
        rows.append({"what": name} | alone(kind, cells, height, json.dumps(solver)))
    columns = list(dict.fromkeys(column for row in rows for column in row))
    with (HERE / "solver3d.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    return rows


if __name__ == "__main__":
    if len(sys.argv) > 1:
        kind, cells, height, solver = [*sys.argv[1:], *("", "", f"{SIZE}", "{}")[len(sys.argv) - 1:]]
        print(json.dumps(case(kind, int(cells), float(height), json.loads(solver))))
    else:
        main()
