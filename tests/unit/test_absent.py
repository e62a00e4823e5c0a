"""Absent, not zero: each optional part of a scene, what it builds, imports and times, and that a scene without it does not.

The table says which modules belong to a part.  A plain scene imports none of them; with the part they are there, or the
table would prove nothing.
"""

from __future__ import annotations

import copy
import json
import subprocess
import sys
import textwrap

import pytest

PLAIN = {
    "geometry": "axisymmetric",
    "materials": {"m": {"flow_stress": {"law": "constant", "value": 100}, "density": "7800 kg/m^3", "young": "200 GPa",
                        "poisson": 0.3, "conductivity": "40 W/m/K", "specific_heat": "600 J/kg/K"}},
    "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 10]}, "material": "m", "mesh_size": 4}},
    "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 10], "normal": [0, -1]},
                        "drive": {"kind": "speed", "velocity": [0, -1]}},
              "lower": {"shape": {"kind": "plane", "point": [0, 0], "normal": [0, 1]}}},
    "steps": {"time": 0.5}, "stop": {"time": 1}}
DIE = {"kind": "rectangle", "from": [0, 10], "to": [15, 20]}
HELD = {"z_high": ["r", "z"]}
HOT = {"kind": "constant", "coefficient": "5 kW/m^2/K", "temperature": 100}

# part: what the scene says of it, modules, entries of summary "parts_built", of "wall_s_by_part", columns of the history
PARTS = {
    "friction": ({"tools": {"upper": {"friction": {"law": "siebel", "factor": 0.2}}}},
                 [], ["friction upper: siebel"], [], []),
    "weight": ({"process": {"weight": True}}, ["physics.mass"], ["term weight"], [], []),
    "inertia": ({"process": {"inertia": True}}, ["physics.mass", "process.inertia"], ["term inertia"], [],
                ["kinetic_energy_mJ"]),
    "heat": ({"workpieces": {"b": {"temperature": 900}}, "tools": {"upper": {"heat_exchange": HOT}}},
             ["physics.thermal", "process.heat.heating", "results.recording.heat_ledger"], ["heat conduction"], ["heat"],
             ["max_temperature_degC"]),
    "tool deformation": ({"tools": {"upper": {"shape": DIE, "material": "m", "mesh_size": 5, "held": HELD}}},
                         ["physics.tool_body", "physics.bordering", "process.tools.deformation", "process.tools.elastic",
                          "physics.contact.tool_surface"],
                         ["tool deformation upper: iterated"], [], ["deflection_upper_mm"]),
    "press frame": ({"tools": {"upper": {"drive": {"stiffness": "1000 kN/mm"}}}},
                    ["physics.bordering", "process.tools.deformation", "process.tools.stability"],
                    ["tool deformation upper: iterated"], [], ["deflection_upper_mm"]),
    "body contact": ({"workpieces": {"c": {"shape": {"kind": "rectangle", "from": [0, 10], "to": [10, 14]}, "material": "m",
                                           "mesh_size": 4}},
                      "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 14], "normal": [0, -1]}}},
                      "contacts": [{"between": ["b", "c"]}]},
                     ["physics.contact.interfaces", "physics.contact.gap_operator", "process.assembling"],
                     ["contact b-c: none"], [], ["contact_force_b_c_N"]),
    "remeshing": ({"workpieces": {"b": {"remesh": {"every": 1}}}},
                  ["process.meshes.keeper", "process.meshes.triggers", "process.meshes.transfer",
                   "physics.remeshing.plane"], [], ["remeshing"], []),
    "points": ({"points": {"p": {"body": "b", "at": [2, 2]}}}, [], [], [], ["p_r_mm"]),
    "damage": ({"materials": {"m": {"damage": {"law": "cockcroft_latham"}}}}, [], ["damage cockcroft_latham"], [],
               ["max_damage"]),
}
DRAWING = ["pyvista", "vtk", "matplotlib", "meshio", "rich"]

RUN = """
    import json, sys
    import fenics_forming as ff

    results = ff.simulate(ff.Scene.read(json.loads(sys.argv[1])))
    print(json.dumps({"built": results.summary["parts_built"], "timed": list(results.summary["wall_s_by_part"]),
                      "columns": results.history.columns, "imported": list(sys.modules)}))
"""


def merged(base: dict, changes: dict) -> dict:
    base = copy.deepcopy(base)
    for key, value in changes.items():
        base[key] = merged(base.get(key, {}), value) if isinstance(value, dict) and key != "shape" else value
    return base


def run(part: str | None) -> dict:
    scene = PLAIN if part is None else merged(PLAIN, PARTS[part][0])
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(RUN), json.dumps(scene)], capture_output=True, text=True,
                          timeout=900)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_plain_scene_builds_imports_times_and_writes_nothing_of_any_optional_part():
    plain = run(None)
    assert plain["built"] == ["term plastic", "term incompressibility", "term contact", "scheme midpoint"]
    assert plain["timed"] == ["assembly", "linear solve", "contact search", "shifting", "output", "fold search", "other"]
    assert plain["columns"] == ["step", "time_s", "dt_s", "stroke_upper_mm", "force_upper_N", "force_lower_N",
                                "volume_b_mm3", "volume_error_b", "power_imbalance", "max_effective_strain",
                                "newton_iterations", "wall_s"]
    modules = {f"fenics_forming.{m}" for _, modules, *_ in PARTS.values() for m in modules} | set(DRAWING)
    assert not modules & set(plain["imported"])
    assert not [m for m in plain["imported"] if m.startswith("fenics_forming.physics.iterative")]


@pytest.mark.long
@pytest.mark.parametrize("part", PARTS)
def test_what_a_part_builds_is_there_with_it_and_nothing_of_the_others(part):
    """With the table right for each part, that nothing of it is in the plain scene means something."""
    _, modules, built, timed, columns = PARTS[part]
    found = run(part)
    assert {f"fenics_forming.{m}" for m in modules} <= set(found["imported"])
    assert set(built) <= set(found["built"]) and set(timed) <= set(found["timed"])
    assert set(columns) <= set(found["columns"])
    expected = {b for b in found["built"] if not b.startswith(("term", "scheme", "drive", "heat"))}
    assert expected <= {b for b in built if not b.startswith("term")}, "something that was not asked for"
