"""The package's side of a comparison with a peer: runs one case on several meshes, a line of JSON each.

    env/run python3 benchmarks/peers/ours.py billet        # or ring, smooth_ring, block, block_20, block_30, shrink_fit
"""

from __future__ import annotations

import json
import sys
from functools import partial
from time import process_time

import fenics_forming as ff

LINEAR, PERFECT = {"law": "linear", "initial": 700, "hardening": 300}, {"law": "constant", "value": 700}


def upset(low, high, law, friction, mesh, step, stop, **body) -> ff.Scene:
    """The upper half of a ring or billet under a plane."""
    return ff.Scene.read({
        "geometry": "axisymmetric", "materials": {"m": {"flow_stress": law}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": low, "to": high}, "material": "m", "symmetry": ["z"],
                             "mesh_size": mesh, **body}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, high[1]], "normal": [0, -1]}, "friction": friction,
                            "drive": {"kind": "speed", "velocity": [0, -1]}}},
        "points": {"bore": {"body": "b", "at": [low[0], 0]}, "equator": {"body": "b", "at": [high[0], 0]}},
        "steps": {"stroke": step}, "stop": {"stroke": stop}, "output": {"strokes": [], "fields_every": 0}})


def stations(scene: ff.Scene, count: int) -> ff.Scene:
    """The scene with rows at ``count`` equal parts of its stroke."""
    return scene.replaced(output={"strokes": [scene.stop.stroke * k / count for k in range(1, count + 1)],
                                 "fields_every": 0, "checkpoint_every": 0})


def billet(mesh=1.0, step=0.45):
    scene = upset([0, 0], [10, 15], LINEAR, {"law": "sticking"}, mesh, step, 9.0)
    return scene, 6, lambda row: {"force_kN": row["force_upper_N"] / 1e3, "radius_mm": row["equator_r_mm"]}


def ring(mesh=0.5, step=0.06, friction=None):
    scene = upset([4.5, 0], [9, 3], PERFECT, friction or {"law": "coulomb", "coefficient": 0.1}, mesh, step, 1.2)
    return scene, 4, lambda row: {"force_kN": row["force_upper_N"] / 1e3, "radius_mm": row["equator_r_mm"],
                                  "bore_mm": row["bore_r_mm"]}


def smooth_ring(mesh=0.5, step=0.06):
    return ring(mesh, step, {"law": "none"})


def block(mesh=3.0, step=0.5):
    scene = cube(mesh, step, 1.5, {"kind": "plane", "point": [0, 0, 15], "normal": [0, 0, -1]})
    return scene, 1, found_of_block


def far_block(stroke, mesh, step):
    """The plate ends with the face, so that no side can fold onto it; the edges turn by more than a right angle."""
    plate = {"kind": "box", "from": [0, 0, 15], "to": [15, 15, 20]}
    return cube(mesh, step, stroke, plate, remesh=True), round(stroke / 1.5), found_of_block


def cube(mesh, step, stroke, plate, **body) -> ff.Scene:
    """One eighth of a cube of 30 mm under a plate that it sticks to."""
    size = 15.0
    return ff.Scene.read({
        "geometry": "3d", "materials": {"m": {"flow_stress": LINEAR}},
        "workpieces": {"b": {"shape": {"kind": "box", "from": [0, 0, 0], "to": [size] * 3}, "material": "m",
                             "symmetry": ["x", "y", "z"], "mesh_size": mesh, **body}},
        "tools": {"upper": {"shape": plate, "symmetry": ["x", "y"] if plate["kind"] == "box" else [],
                            "drive": {"kind": "speed", "velocity": [0, 0, -1]}, "friction": {"law": "sticking"}}},
        "points": {"side": {"body": "b", "at": [size, 0, 0]}}, "steps": {"stroke": step}, "stop": {"stroke": stroke}})


def found_of_block(row) -> dict:
    return {"force_kN": row["force_upper_N"] / 1e3, "half_width_mm": row["side_x_mm"]}


def shrink_fit(mesh=2.5, step=None):
    parts = {name: {"shape": {"kind": "rectangle", "from": [inner, 0], "to": [outer, 5]}, "material": "steel",
                    "mesh_size": mesh} for name, inner, outer in (("insert", 20, 40), ("ring", 40, 80))}
    scene = ff.Scene.read({
        "geometry": "axisymmetric", "materials": {"steel": {"young": 210e3, "poisson": 0.3}},
        "tools": {"die": {"parts": parts, "held": {"z_low": "z", "z_high": "z"}}},
        "contacts": [{"between": ["insert", "ring"], "interference": 0.04}]})
    return scene, 0, lambda row: {"pressure_MPa": row["contact_pressure_insert_ring_MPa"]}


CASES = {"billet": (billet, [(4.0, 1.5), (3.0, 1.5), (3.0, 0.9), (2.5, 0.9), (1.5, 0.9), (1.5, 0.6), (1.5, 0.45),
                             (1.0, 0.45), (0.7, 0.225)], (4.0, 4.5)),
         "smooth_ring": (smooth_ring, [(1.5, 0.24), (1.5, 0.12), (0.5, 0.06), (0.25, 0.03)], (1.5, 0.6)),
         "ring": (ring, [(1.5, 0.24), (1.5, 0.12), (1.0, 0.12), (0.5, 0.12), (0.5, 0.06), (0.25, 0.06), (0.125, 0.03),
                         (0.08, 0.02)], (1.5, 0.6)),
         "block": (block, [(4.0, 0.75), (3.0, 0.75), (3.0, 0.5), (2.2, 0.5), (1.6, 0.5)], (8.0, 0.75)),
         "block_20": (partial(far_block, 3.0), [(5.0, 0.75), (4.0, 0.75), (3.5, 0.75), (3.0, 0.75)], (8.0, 0.75)),
         "block_30": (partial(far_block, 4.5), [(5.0, 0.75), (4.0, 0.75), (3.5, 0.75), (3.0, 0.75)], (8.0, 0.75)),
         "shrink_fit": (shrink_fit, [(1.25, 0), (0.6, 0), (0.3, 0)], (5.0, 0))}


def measured(make, mesh: float, step: float) -> dict:
    """CPU seconds of a run, its mesh included, and what it found."""
    before = process_time()
    scene, count, found = make(mesh, step)
    results = ff.simulate(stations(scene, count) if count else scene)
    spent = process_time() - before
    rows = {k: found(results.at(stroke=scene.stop.stroke * k / count)) for k in range(1, count + 1)} if count \
        else {1: found(results.history.rows[-1])}
    return {"setup": f"{mesh:g} mm" + (f", step {step:g} mm" if step else ""), "finished": True, "cpu_s": spent,
            "unknowns": results.summary.get("dofs", 0), "stations": rows}


def main(name: str) -> None:
    """All meshes of a case, after a coarse run that compiles the forms."""
    make, cases, warm_up = CASES[name]
    measured(make, *warm_up)
    for case in cases:
        print(json.dumps(measured(make, *case)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
