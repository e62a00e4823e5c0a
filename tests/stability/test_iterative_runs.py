"""Heat, unknown motions of tools, inertia, tools that deform: iterations in space find what a factorisation does."""

from __future__ import annotations

import numpy as np
import pytest

from .scenes import run, swept
from .test_ranks import on_ranks, same

BLOCK = """
geometry = "3d"
solver = {{ linear = "iterative" }}
{process}
[materials.metal]
flow_stress = {{ law = "linear", initial = "200 MPa", hardening = "100 MPa" }}
density = "7800 kg/m^3"
conductivity = "28 W/m/K"
specific_heat = "650 J/kg/K"
[materials.steel]
young = "210 GPa"
poisson = 0.3
[workpieces.block]
shape = {{ kind = "box", from = [0, 0, 0], to = [10, 8, 6] }}
material = "metal"
mesh_size = "3 mm"
{workpiece}
[tools.upper]
friction = {{ law = "siebel", factor = 0.2 }}
{tool}
[steps]
{steps}
"""
PLATE = """shape = { kind = "plane", point = [0, 0, 6], normal = [0, 0, -1] }
"""
PARTS = {
    "heat": {"workpiece": 'temperature = "900 degC"\nsymmetry = ["x", "y", "z"]\n'
                          'air = { temperature = "20 degC", coefficient = "200 W/m^2/K" }',
             "tool": PLATE + 'drive = { kind = "speed", velocity = [0, 0, "-10 mm/s"] }\n'
                     'heat_exchange = { kind = "constant", temperature = "200 degC", coefficient = "10 kW/m^2/K" }'},
    "frame": {"workpiece": 'symmetry = ["x", "y", "z"]',
              "tool": PLATE + 'drive = { kind = "speed", velocity = [0, 0, "-1 mm/s"], stiffness = "100 kN/mm" }'},
    "inertia": {"workpiece": 'initial_velocity = [0, 0, "30 m/s"]\nsymmetry = ["x", "y"]',
                "process": "process = { inertia = true }",
                "tool": PLATE, "steps": 'time = "2 us"\n[stop]\ntime = "12 us"'},
    "die": {"workpiece": 'symmetry = ["x", "y", "z"]',
            "tool": 'shape = { kind = "box", from = [0, 0, 6], to = [30, 30, 26] }\nsymmetry = ["x", "y"]\n'
                    'material = "steel"\nmesh_size = { contact = "4 mm", far = "15 mm" }\n'
                    'held = { z_high = ["x", "y", "z"] }\n'
                    'drive = { kind = "speed", velocity = [0, 0, "-1 mm/s"] }'},
}
# Newton stops where forces change by 2e-3; what the two find differs by what is left then
HELD = {"heat": ("force_upper_N", "max_effective_strain"), "frame": ("force_upper_N", "stroke_upper_mm"),
        "inertia": ("force_upper_N", "max_effective_strain"), "die": ("force_upper_N", "deflection_upper_mm")}
WITHIN = 2e-3


def scene(name: str) -> str:
    parts = {"process": "", "steps": 'stroke = "0.05 mm"\n[stop]\nstroke = "0.15 mm"'} | PARTS[name]
    return BLOCK.format(**parts)


@pytest.mark.parametrize("name", list(PARTS))
def test_iterations_find_the_run_of_a_factorisation(name, tmp_path):
    iterated = run(scene(name), tmp_path / "iterated").results
    directly = run(scene(name), tmp_path / "direct", "solver.linear='direct'").results
    assert [r.summary["linear_solver"]["kind"] for r in (iterated, directly)] == ["iterative", "direct"]
    assert "solved directly" not in iterated.summary["linear_solver"]
    for column in HELD[name]:
        one, other = iterated.history.column(column), directly.history.column(column)
        assert np.abs(one - other).max() <= WITHIN * np.abs(other).max(), (column, one, other)
    if name == "heat":
        coldest = [r.history.column("min_temperature_degC") for r in (iterated, directly)]
        np.testing.assert_allclose(*coldest, rtol=1e-4)


@pytest.mark.mpi
@pytest.mark.parametrize("name", swept(["die"], ["heat", "frame", "inertia"]))
def test_iterations_find_the_same_on_two_ranks(name, tmp_path):
    one = run(scene(name), tmp_path / "one").results
    two = on_ranks(2, scene(name), tmp_path / "two", timeout=900)
    same(one.history, two.history)
    alone, shared = (r.summary["linear_solver"] for r in (one, two))
    assert alone.keys() == shared.keys() and alone["kind"] == shared["kind"] == "iterative"
    # a solve that ends just at its tolerance may take one iteration more
    assert shared["krylov iterations"] == pytest.approx(alone["krylov iterations"], rel=0.02)
