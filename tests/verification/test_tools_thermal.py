"""Thermal strain of tools: free expansion, held bars, the heated cylinder, yielding by heat, balance of work."""

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming import FixedDisplacement, Pressure, laws
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.tool_body import PlasticSolver, ToolBody, fields

from .shapes import ring_sector, side
from .test_tools_elastic import KINDS, at_radius, block, radial, symmetric

E, NU, ALPHA = 210e3, 0.3, 1.2e-5
STEEL = laws.Elasticity(young=E, poisson=NU, expansion=ALPHA)


@pytest.mark.parametrize("law", [STEEL, STEEL.replaced(yield_stress=240)], ids=["elastic", "plastic"])
@pytest.mark.parametrize("kind", KINDS)
def test_free_body_expands_without_stress(kind, law):
    """alpha (T - T_0) in all directions; in plane strain the stress across is -E alpha (T - T_0), the strain in the plane
    (1 + nu) times that of free expansion."""
    mesh = block(kind)
    last = mesh.topology.dim - 1
    held = [FixedDisplacement(side(mesh, last, 0.0), last)]
    held += [] if kind == "axisymmetric" else symmetric(mesh, *range(last))
    tool = ff.solve_tool(mesh, kinematics=kind, material=law, held=held, temperature=60.0)
    strain = ALPHA * 40 * (1 + NU if kind == "plane_strain" else 1)
    assert tool.displacement == pytest.approx(strain * tool.x, abs=1e-13)
    across = -E * ALPHA * 40 if kind == "plane_strain" else 0.0
    expected = np.zeros_like(tool.stress)
    expected[:, 2] = across
    assert tool.stress == pytest.approx(expected, abs=1e-7)


def test_cylinder_heated_from_its_bore():
    """T = T_a ln(b/r) / ln(b/a): hoop stresses at both faces and the outer displacement of the plane-strain closed form
    (Timoshenko and Goodier, Theory of Elasticity, 151)."""
    a, b, heat = 20.0, 50.0, 100.0
    mesh = ring_sector(a, b, 12, 12)
    radius = np.hypot(*Nodes(mesh).x.T)
    tool = ff.solve_tool(mesh, kinematics="plane_strain", material=STEEL, held=symmetric(mesh, 0, 1),
                         temperature=heat * np.log(b / radius) / np.log(b / a), stress_free=0.0)
    scale, log = E * ALPHA * heat / (2 * (1 - NU) * np.log(b / a)), np.log(b / a)
    on_axis = np.isclose(tool.x[:, 1], 0)
    for r, hoop in ((a, scale * (1 - 2 * b**2 / (b**2 - a**2) * log)), (b, scale * (1 - 2 * a**2 / (b**2 - a**2) * log))):
        assert tool.stress[on_axis & np.isclose(radius, r), 1] == pytest.approx(hoop, rel=1e-2)
    # u(b) = 2 (1 + nu) alpha b / (b² - a²) times the integral of T r dr
    integral = heat / log * ((b**2 - a**2) / 4 - a**2 / 2 * log)
    assert radial(tool)[1][np.isclose(radius, b)] == pytest.approx(2 * (1 + NU) * ALPHA * b / (b**2 - a**2) * integral,
                                                                   rel=1e-3)


@pytest.mark.parametrize("law", [STEEL, STEEL.replaced(yield_stress=240, hardening=5e3)], ids=["elastic", "plastic"])
def test_held_bar_is_stressed_by_heat_and_yields(law):
    """A bar between walls: -E alpha dT, beyond the yield stress along the line of the tangent modulus; after it has
    cooled it pulls. Heat does the work that is stored and dissipated: the walls do not move."""
    mesh = block("plane_stress")
    held = [FixedDisplacement(side(mesh, 1, at), 1) for at in (0.0, 1.0)] + symmetric(mesh, 0)
    body = ToolBody(Nodes(mesh), kinematics="plane_stress", material=law, held=held)
    solver = PlasticSolver(body) if law.yields else None
    if solver is None:
        tool = ff.solve_tool(mesh, kinematics="plane_stress", material=law, held=held, temperature=220.0)
        assert tool.stress[:, 1] == pytest.approx(np.full(len(tool.x), -E * ALPHA * 200), rel=1e-9)
        assert tool.thermal_work == pytest.approx(-tool.elastic_energy, rel=1e-9)
        return
    slope = 5e3 / (1 + 5e3 / E)
    plastic = ALPHA * 200 - 240 / E
    hot = -(240 + slope * plastic)
    for temperature, stress in ((220.0, hot), (60.0, hot + E * ALPHA * 160)):
        body.set_temperature(temperature)
        tool = fields(solver, solver.solve(steps=4))
        assert abs(stress) <= abs(hot), "cooling is elastic"
        assert tool.stress[:, 1] == pytest.approx(np.full(len(tool.x), stress), rel=1e-6)
        assert tool.external_work == pytest.approx(0, abs=1e-9)
        assert -tool.thermal_work == pytest.approx(tool.elastic_energy + tool.plastic_work, rel=1e-9)


def test_works_of_load_and_heat_balance_in_a_yielding_cylinder():
    """Pressure and heat at once, unevenly: external = elastic + plastic + thermal."""
    mesh = ring_sector(100, 200, 6, 6)
    body = ToolBody(Nodes(mesh), kinematics="plane_strain", material=STEEL.replaced(yield_stress=240),
                    held=symmetric(mesh, 0, 1))
    solver = PlasticSolver(body)
    for pressure, heat in ((130, 80), (150, 20), (0, 0)):
        body.set_temperature(heat * 100 / np.hypot(*body.nodes.x.T), stress_free=0.0)
        tool = fields(solver, solver.solve([Pressure(at_radius(mesh, 100), pressure)], steps=4))
        inside = tool.elastic_energy + tool.plastic_work + tool.thermal_work
        assert tool.external_work == pytest.approx(inside, rel=1e-7)
        assert abs(tool.thermal_work) > 1e-3 * tool.plastic_work > 0


def test_tool_without_temperature_builds_no_thermal_strain():
    mesh = block("plane_strain")
    cold = ff.solve_tool(mesh, kinematics="plane_strain", material=STEEL, held=symmetric(mesh, 0, 1))
    assert cold.body.heating is None and cold.thermal_work == 0.0
    with pytest.raises(ff.FormingError, match="expansion"):
        ff.solve_tool(mesh, kinematics="plane_strain", material=laws.Elasticity(young=E, poisson=NU), temperature=50.0,
                      held=symmetric(mesh, 0, 1))
