"""Elastic-plastic tools: closed forms (REFERENCES.md 6.6-6.8), tangent, convergence, balance of work, unloading."""

import numpy as np
import pytest
from dolfinx.fem import petsc as fem_petsc

import fenics_forming as ff
from fenics_forming import FixedDisplacement, FixedPoint, Pressure, ToolSettings, laws, meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.tool_body import PlasticSolver, ToolBody, fields

from .shapes import ring_sector, side
from .test_tools_elastic import KINDS, at_radius, block, radial, symmetric

E, NU, YIELD = 210e3, 0.3, 240.0
PERFECT = laws.Elasticity(young=E, poisson=NU, yield_stress=YIELD)
HARDENING = PERFECT.replaced(hardening=5e3)
TABLE = laws.Elasticity(young=E, poisson=NU, hardening=[(0, 240), (5e-4, 260), (3e-3, 300), (1, 400)])
LAWS = {"perfect": PERFECT, "linear": HARDENING, "table": TABLE}


def quarter(kind, n, law=PERFECT, settings=ToolSettings()):
    """A quarter of the thick cylinder, or in axisymmetry of the thick sphere, 100 to 200 mm."""
    mesh = ring_sector(100, 200, n, n)
    body = ToolBody(Nodes(mesh), kinematics=kind, material=law, held=symmetric(mesh, 0, 1))
    return PlasticSolver(body, settings), at_radius(mesh, 100)


def go(solver, bore, pressure, steps=None):
    return fields(solver, solver.solve([Pressure(bore, pressure)], steps=steps))


# ---------------------------------------------------------------------- closed forms
def test_thick_cylinder_yields_from_the_bore_outwards_and_collapses(verified):
    """REFERENCES.md 6.6, 0.5 %: displacements at four pressures; load control ends at (2 / sqrt 3) sigma_y ln(b/a)."""
    solver, bore = quarter("plane_strain", 10)
    exact = ((120, 0.111108, 0.070420, 108.0), (140, 0.139815, 0.087288, 120.4), (160, 0.183435, 0.111645, 136.5),
             (190, 0.362383, 0.205405, 186.5))
    for pressure, inner, outer, front in exact:
        tool = go(solver, bore, pressure, steps=5)
        radius, u = radial(tool)
        assert u[np.isclose(radius, 100)] == pytest.approx(inner, rel=5e-3)
        assert u[np.isclose(radius, 200)] == pytest.approx(outer, rel=5e-3)
        verified("6.6", f"displacement at {pressure} MPa", [u[np.isclose(radius, r)].mean() for r in (100, 200)],
                 (inner, outer), within=5e-3, unit="mm", at=("bore", "outside"))
        # how far points have yielded, by their volume: pi/4 (c² - a²), to a third of a cell (7 % of the radius)
        plastic = solver.plastic.effective > 0
        found = np.sqrt(100**2 + solver.body.volumes[plastic].sum() * 4 / np.pi)
        assert found == pytest.approx(front, rel=0.025)
    assert solver.factor.factorisations == 1
    with pytest.raises(ff.ConvergenceError, match="carries .* % of the step to its new loads"):
        solver.solve([Pressure(bore, 200)])
    reached = 190 + 10 * solver.reached
    # the last step that was tried and failed is 0.01 MPa above
    verified("6.6", "collapse by load control", reached, 192.0906, within=1e-3, unit="MPa")
    # the tool is left with what it carries
    tool = fields(solver)
    pushed = np.einsum("ni->i", tool.body.nodal_forces(solver.force))
    assert pushed == pytest.approx([100 * reached] * 2, rel=1e-6)
    assert tool.von_mises.max() < 1.05 * YIELD, "stresses carried to the nodes may overshoot a little"


def test_thick_cylinder_of_solid_cells_does_not_lock():
    """The same as a slice in space between two planes, 4 x 4 x 1 cubes of tetrahedra: 1 % at 190, collapse 0.1 %."""
    mesh = meshing.box((np.log(100), 0, 0), (np.log(200), np.pi / 2, 20), (4, 4, 1))
    x = mesh.geometry.x
    radius, angle = np.exp(x[:, 0]), x[:, 1].copy()
    x[:, 0], x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    x[np.abs(x) < 1e-9] = 0.0
    held = [*symmetric(mesh, 0, 1, 2), FixedDisplacement(side(mesh, 2, 20.0), 2)]
    solver = PlasticSolver(ToolBody(Nodes(mesh), kinematics="3d", material=PERFECT, held=held))
    bore = at_radius(mesh, 100)
    for pressure, inner, tolerance in ((160, 0.183435, 5e-3), (190, 0.362383, 1e-2)):
        tool = go(solver, bore, pressure, steps=5)
        found = np.hypot(*tool.displacement[:, :2].T)[np.isclose(np.hypot(*tool.x[:, :2].T), 100)]
        assert found.mean() == pytest.approx(inner, rel=tolerance)
    with pytest.raises(ff.ConvergenceError):
        solver.solve([Pressure(bore, 210)], steps=20)
    assert 190 + 20 * solver.reached == pytest.approx(192.0906, rel=1e-3)


def elastic_plastic_sphere(front):
    """Pressure and outer displacement at which the thick sphere has yielded up to a radius (exact for every nu)."""
    pressure = 2 * YIELD * np.log(front / 100) + 2 * YIELD / 3 * (1 - front**3 / 200**3)
    return pressure, YIELD * front**3 * (1 - NU) / (E * 200**2)


def test_thick_sphere_as_a_quarter_in_axisymmetry(verified):
    """REFERENCES.md 6.7, 0.5 %: displacement outside for fronts at 100 (all elastic), 120, 160, 180; collapse."""
    assert elastic_plastic_sphere(120) == pytest.approx((212.9543, 0.034560), rel=1e-5)
    solver, bore = quarter("axisymmetric", 10)
    for front in (100, 120, 160, 180):
        pressure, outer = elastic_plastic_sphere(front)
        # points next to the bore, not on it, see the yield stress first
        tool = go(solver, bore, pressure, steps=5)
        radius, u = radial(tool)
        assert u[np.isclose(radius, 200)] == pytest.approx(outer, rel=5e-3)
        verified("6.7", f"outer displacement, plastic to {front} mm", u[np.isclose(radius, 200)].mean(), outer, within=5e-3,
                 unit="mm")
        if front == 100:
            assert tool.iterations == 1 and tool.plastic_strain.max() == 0
    with pytest.raises(ff.ConvergenceError):
        solver.solve([Pressure(bore, 350)])
    verified("6.7", "collapse by load control", pressure + (350 - pressure) * solver.reached, 332.7106, within=2e-3,
             unit="MPa")


def bend(law, curvatures, cells=17):
    """Upper half of a beam 2 x 20 x 1 mm in plane stress, bent to curvatures in units of that at first yield; moments in
    units of M_y = sigma_y h²/6 and the field of the last. Yield fronts lie within cells: on their sides all is exact."""
    height, length = 10.0, 2.0
    mesh = meshing.rectangle((0, 0), (length, height), (2, cells))
    first = YIELD / E / height
    end = side(mesh, 0, length)
    body = ToolBody(Nodes(mesh), kinematics="plane_stress", material=law, held=[
        FixedDisplacement(side(mesh, 0, 0.0), 0), FixedDisplacement(side(mesh, 1, 0.0), 0), FixedPoint((0, 0), 1),
        FixedDisplacement(end, 0, lambda x: first * length * x[:, 1])])
    solver, moments = PlasticSolver(body), []
    for curvature in curvatures:
        tool = fields(solver, solver.solve(held=curvature, steps=1))
        on_end = np.isclose(tool.x[:, 0], length)
        moments.append(2 * np.sum(tool.reactions[on_end, 0] * tool.x[on_end, 1]) / (YIELD * (2 * height) ** 2 / 6))
    return np.array(moments), tool


def test_plastic_bending_of_a_rectangular_section(verified):
    """REFERENCES.md 6.8, 0.5 %: M / M_y = 1.5 - 0.5 / k²; sigma_x alone, so plane stress with its strain across."""
    curvatures = np.array([0.5, 0.99, 4 / 3, 2, 4, 100])
    moments, tool = bend(PERFECT, curvatures)
    verified("6.8", "moment over that of first yield", moments,
             np.where(curvatures < 1, curvatures, 1.5 - 0.5 / curvatures**2), within=5e-3,
             at=[f"curvature {c:.4g}" for c in curvatures])
    # the stress jumps from -sigma_y to sigma_y within one cell at the middle: beside it 3 % of it points elsewhere
    assert np.abs(tool.stress[:, 1:]).max() < 0.05 * YIELD
    assert tool.external_work == pytest.approx(tool.elastic_energy + tool.plastic_work, rel=1e-8)


def test_bent_beam_springs_back_elastically():
    """Bent to twice the first curvature and let go: the moment M frees the elastic curvature M / EI."""
    moments, _ = bend(PERFECT, [4 / 3, 2])
    left = 2 - moments[-1]
    again, tool = bend(PERFECT, [4 / 3, 2, left])
    assert again[-1] == pytest.approx(0, abs=5e-3)
    # residual stress at the outer fibre: -sigma_y + M y / I reversed = sigma_y (1 - M / M_y)
    outer = np.isclose(tool.x[:, 1], 10)
    assert tool.stress[outer, 0] == pytest.approx(YIELD * (1 - 1.375), rel=1e-2)


@pytest.mark.parametrize("law", ["linear", "table"])
@pytest.mark.parametrize("kind", ["plane_stress", "axisymmetric", "3d"])
def test_bar_follows_its_yield_curve(law, kind):
    """A block pulled along its last axis with free sides is uniaxial, whatever its cells (not in plane strain)."""
    law = LAWS[law]
    mesh = block(kind)
    last = mesh.topology.dim - 1
    high = side(mesh, last, 1.0)
    held = [FixedDisplacement(side(mesh, last, 0.0), last), FixedDisplacement(high, last, 1.0)]
    if kind != "axisymmetric":
        held += symmetric(mesh, *range(last))
    solver = PlasticSolver(ToolBody(Nodes(mesh), kinematics=kind, material=law, held=held))
    for strain in (5e-4, 2e-3, 8e-3):
        solver.solve(held=strain, steps=3)
        p = np.linspace(0, 0.01, 200001)
        stress = np.interp(strain, p + law.yield_stress_at(p) / E, law.yield_stress_at(p)) if strain > YIELD / E \
            else E * strain
        at = {"axisymmetric": 1, "3d": 2}.get(kind, 1)
        assert solver.plastic.stress[:, at] == pytest.approx(np.full(len(solver.plastic.stress), stress), rel=1e-6)
        assert solver.plastic.effective == pytest.approx(np.full(len(solver.plastic.effective), strain - stress / E),
                                                         abs=1e-9)


# ---------------------------------------------------------------------- tangent and Newton
def loaded_block(kind, law, settings=ToolSettings()):
    mesh = block(kind)
    last = mesh.topology.dim - 1
    held = [FixedDisplacement(side(mesh, last, 0.0), i) for i in range(last + 1)]
    spring = ff.Springs(side(mesh, last, 1.0), 1e4, last)
    body = ToolBody(Nodes(mesh), kinematics=kind, material=law, held=held, springs=[spring])
    return PlasticSolver(body, settings), Pressure(side(mesh, last, 1.0), lambda x: 330 + 30 * x[:, 0])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", KINDS)
def test_tangent_is_the_derivative_of_the_internal_forces(kind, law):
    """Assembled, with springs, from a state with a history; central differences along a smooth displacement."""
    solver, load = loaded_block(kind, LAWS[law].replaced(hardening=LAWS[law].hardening or 0))
    body = solver.body
    solver.solve([Pressure(load.facets, 270)], steps=2)
    assert (solver.plastic.effective > 0).any()
    x = body.nodes.x
    start = body.nodal()
    further, along = 4e-3 * x**2 * [1, -1, 0.5][: body.nodes.dim], np.sin(x[:, ::-1] + 0.3)

    def forces(factor):
        body.displacement.x.array[body.dofs] = start + further + factor * along
        solver._respond()
        return solver.internal_forces()

    step = 1e-8
    difference = (forces(step) - forces(-step)) / (2 * step)
    forces(0.0)
    solver.bulk.pack()
    matrix = fem_petsc.assemble_matrix(solver.bulk.tangent_form)
    matrix.assemble()
    direction, product = matrix.createVecs()
    direction.array[body.dofs] = along
    matrix.mult(direction, product)
    # rounding of the forces over the step: 1e-16 * 1e2 / 1e-8 against stiffnesses of 1e5
    assert (product - difference).norm() < 1e-6 * difference.norm()
    transposed = matrix.copy().transpose()
    transposed.axpy(-1.0, matrix)
    assert transposed.norm() < 1e-13 * matrix.norm(), "symmetric: the factorisation is LDL^T"


@pytest.mark.parametrize("kind", KINDS)
def test_newton_converges_quadratically(kind):
    """One load step deep into the plastic range: the imbalance of successive iterations is squared at the end."""
    solver, load = loaded_block(kind, HARDENING)
    found = []
    imbalance = solver._imbalance

    def listening(target):
        found.append(imbalance(target) / 330)
        return found[-1]

    solver._imbalance = listening
    solver.solve([load], steps=1)
    assert len(found) < 12
    norms = [n for n in found if n > 1e-11]     # beyond is rounding
    first, second, third = np.log(norms[-3:])
    assert (third - second) / (second - first) > 1.6, found


def test_load_in_one_step_or_many_differs_by_the_path_only():
    """Proportional loading: the state hardly depends on the steps; 0.3 % in one step (notes), 0.05 % from 5 to 10."""
    shifts = []
    for steps in (1, 5, 10):
        solver, bore = quarter("plane_strain", 6)
        radius, u = radial(go(solver, bore, 170, steps=steps))
        shifts.append(u[np.isclose(radius, 100)].mean())
    assert shifts[:2] == pytest.approx([shifts[2]] * 2, rel=4e-3)
    assert shifts[1] == pytest.approx(shifts[2], rel=1e-3)


def test_steps_that_fail_are_cut_and_lead_to_the_same_state():
    """So few iterations allowed that whole steps fail: smaller ones take over, and the answer is that of small steps."""
    shifts = []
    for settings, steps in ((ToolSettings(max_iterations=4), 2), (ToolSettings(), 40)):
        solver, bore = quarter("plane_strain", 6, settings=settings)
        accepted = []
        accept = solver._accept
        solver._accept = lambda force, accept=accept, accepted=accepted: (accepted.append(force), accept(force))
        radius, u = radial(go(solver, bore, 180, steps=steps))
        shifts.append(u[np.isclose(radius, 100)].mean())
        assert len(accepted) > 2
    assert shifts[0] == pytest.approx(shifts[1], rel=3e-3)


# ---------------------------------------------------------------------- balances and invariance
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", KINDS)
def test_work_of_loads_and_supports_is_energy_and_plastic_work(kind, law):
    """Loading, moved supports, springs, unloading: external = elastic + springs + plastic, by the balance of forces."""
    solver, load = loaded_block(kind, LAWS[law].replaced(hardening=LAWS[law].hardening or 0))
    last = solver.body.nodes.dim - 1
    solver.body.held_values[:, last] = np.where(solver.body.is_held[:, last], 1e-3, 0.0)
    solver.body.moves_supports = True
    for loads, part in (([load], 0.5), ([load], 1.0), ([], 1.0)):
        solver.solve(loads, held=part, steps=4)
        tool = fields(solver)
        stored = tool.elastic_energy + tool.spring_energy + tool.plastic_work
        assert tool.external_work == pytest.approx(stored, rel=1e-7)
        assert tool.plastic_work > 0.01 * tool.external_work > 0
    # yield stress times effective strain, step by step; the trapezoidal rule differs where stresses turn
    p = np.linspace(0, solver.plastic.effective.max(), 100001)
    below = np.append(0, np.cumsum(LAWS[law].yield_stress_at(0.5 * (p[1:] + p[:-1])) * np.diff(p)))
    by_curve = solver.body.volumes @ np.interp(solver.plastic.effective, p, below)
    assert tool.plastic_work == pytest.approx(by_curve, rel=0.05)


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_motion_of_the_supports_changes_no_stress(kind):
    """Frame invariance with plastic strains: translation, and small rotation where the geometry has one."""
    stresses, shifts = [], []
    mesh = block(kind)
    dim = mesh.topology.dim
    turn = np.zeros((dim, dim))
    if kind != "axisymmetric":
        turn = 1e-2 * np.array([[0, -1, 0.5], [1, 0, -0.3], [-0.5, 0.3, 0]])[:dim, :dim]
    for size in (0.0, 1.0):
        def motion(x, size=size):
            return size * (x @ turn.T + [0.0, 0.2, -0.1][:dim])

        held = [FixedDisplacement(side(mesh, dim - 1, 0.0), i, lambda x, i=i, m=motion: m(x)[:, i]) for i in range(dim)]
        tool = ff.solve_tool(mesh, kinematics=kind, material=HARDENING, held=held, steps=3,
                             loads=[Pressure(side(mesh, dim - 1, 1.0), 350)])
        assert tool.plastic_strain.max() > 1e-3
        stresses.append(tool.stress)
        shifts.append(tool.displacement - motion(tool.x))
    # the forces balance to 1e-9 of the largest
    assert stresses[1] == pytest.approx(stresses[0], abs=1e-5)
    assert shifts[1] == pytest.approx(shifts[0], abs=1e-9)


def test_exchanged_axes_exchange_the_answer():
    """A body mirrored on the diagonal: displacements, stresses and plastic strains are mirrored."""
    found = []
    for swap in (False, True):
        mesh = block("plane_strain")
        low, high = (side(mesh, 1, 0.0), side(mesh, 1, 1.0))
        if swap:
            mesh.geometry.x[:, :2] = mesh.geometry.x[:, 1::-1]
        found.append(ff.solve_tool(mesh, kinematics="plane_strain", material=TABLE, loads=[Pressure(high, 330)], steps=3,
                                   held=[FixedDisplacement(low, i) for i in (0, 1)]))
    one, other = found
    assert one.plastic_strain.max() > 1e-4
    assert other.displacement == pytest.approx(one.displacement[:, ::-1], abs=1e-10)
    assert other.stress == pytest.approx(one.stress[:, [1, 0, 2, 3]], abs=1e-5)


def test_unloaded_sphere_keeps_the_difference_of_plastic_and_elastic_state():
    """Unloading is elastic: residual displacement = plastic - elastic solution; loading again to the same pressure is
    elastic as well (shakedown) and finds the same state."""
    solver, bore = quarter("axisymmetric", 8)
    pressure, outer = elastic_plastic_sphere(140)
    radius, u = radial(go(solver, bore, pressure))
    on = np.isclose(radius, 200)
    elastic = pressure * 100**3 * 3 * (1 - NU) * 200 / (2 * E * (200**3 - 100**3))
    unloaded = fields(solver, solver.solve([]))
    assert unloaded.iterations == 1
    assert radial(unloaded)[1][on] == pytest.approx(outer - elastic, rel=2e-2)      # the difference of two near numbers
    assert fields(solver, solver.solve([Pressure(bore, pressure)])).iterations == 1
    assert radial(fields(solver))[1] == pytest.approx(u, abs=1e-9)


def test_part_that_cannot_yield_stays_elastic_beside_one_that_does():
    """Two layers in series under one stress: one yields and hardens, the other follows Hooke."""
    mesh = meshing.rectangle((0, 0), (1, 20), (2, 40))
    nodes = Nodes(mesh)
    middles = nodes.x[mesh.geometry.dofmap[:, :3]].mean(axis=1)
    parts = [(HARDENING, np.flatnonzero(middles[:, 1] < 10)),
             (laws.Elasticity(young=E, poisson=NU), np.flatnonzero(middles[:, 1] > 10))]
    tool = ff.solve_tool(mesh, kinematics="plane_stress", material=parts, held=symmetric(mesh, 0, 1),
                         loads=[Pressure(side(mesh, 1, 20.0), 300)])
    top, interface = np.isclose(tool.x[:, 1], 20), np.isclose(tool.x[:, 1], 10)
    # the layers want to widen differently (nu, and 1/2 where plastic) and shear each other near the interface
    strain = 10 * (300 / E + (300 - YIELD) / 5e3)
    assert tool.displacement[interface, 1].mean() == pytest.approx(-strain, rel=0.05)
    shortening = tool.displacement[interface, 1].mean() - tool.displacement[top, 1].mean()
    assert shortening == pytest.approx(10 * 300 / E, rel=0.05)
    assert tool.plastic_strain[top].max() == 0
