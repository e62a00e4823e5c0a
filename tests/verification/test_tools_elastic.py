"""Elastic tools: closed forms (REFERENCES.md 6.1, 6.9, 6.10), patch test, rigid motions, supports, one factorisation."""

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming import FixedDisplacement, FixedPoint, Pressure, laws, meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.tool_body import ElasticSolver, PlasticSolver, ToolBody, solver_of

from .shapes import observed_orders, ring_sector, side

STEEL = laws.Elasticity(young="210 GPa", poisson=0.3)
KINDS = ["plane_strain", "plane_stress", "axisymmetric", "3d"]


def symmetric(mesh, *axes):
    """The low faces of a body that begins at the origin are symmetry planes."""
    return [FixedDisplacement(side(mesh, axis, 0.0), axis) for axis in axes]


def at_radius(mesh, radius):
    return meshing.boundary_facets(mesh, lambda x: np.isclose(np.hypot(x[0], x[1]), radius))


def radial(tool):
    """Radius and radial displacement of every node."""
    radius = np.hypot(*tool.x.T)
    return radius, np.einsum("ni,ni->n", tool.displacement, tool.x) / np.where(radius > 0, radius, 1)


def block(kind, size=1.0, n=3):
    """A block with irregular cells; in axisymmetry a ring, from the radius 1 on.

    In the plane the cells are curved as well: there the points integrate curved cells exactly, which in axisymmetry and in
    space would take rules of higher degree.
    """
    low = 1.0 if kind == "axisymmetric" else 0.0
    mesh = meshing.box((0, 0, 0), (size,) * 3, (2, 2, 2)) if kind == "3d" else \
        meshing.rectangle((low, 0), (low + size, size), (n, n))
    dim = mesh.topology.dim
    x = mesh.geometry.x[:, :dim]
    s = (x - np.array([low, 0.0, 0.0])[:dim]) / size
    inside = np.prod(np.sin(np.pi * s), axis=1)
    x += 0.06 * size * inside[:, None] * np.sin(5 * s[:, ::-1] + np.arange(dim))
    if kind not in ("plane_strain", "plane_stress"):
        Nodes(mesh).with_mids(x)
    return mesh


# ---------------------------------------------------------------------- closed forms
def lame(n):
    mesh = ring_sector(20, 50, n, n)
    return ff.solve_tool(mesh, kinematics="plane_strain", material=STEEL, held=symmetric(mesh, 0, 1),
                         loads=[Pressure(at_radius(mesh, 20), 300)])


def test_thick_cylinder_under_pressure_is_lames(verified):
    """REFERENCES.md 6.1, 0.5 %: hoop stresses and displacements at bore and outside, and the energy p u(a) 2 pi a / 2."""
    tool = lame(12)
    radius, u = radial(tool)
    assert tool.components == ("xx", "yy", "zz", "xy")
    on_axis = np.isclose(tool.x[:, 1], 0)
    for r, hoop, shift in ((20, 414.285714, 0.0470476), (50, 114.285714, 0.0247619)):
        assert u[np.isclose(radius, r)] == pytest.approx(shift, rel=1e-4)
        verified("6.1", f"radial displacement, r = {r} mm", u[np.isclose(radius, r)].mean(), shift, within=1e-4, unit="mm")
        verified("6.1", f"hoop stress, r = {r} mm", tool.stress[on_axis & np.isclose(radius, r), 1].item(), hoop,
                 within=5e-3, unit="MPa")
    # across the plane nu (sigma_r + sigma_t), a constant
    assert tool.stress[:, 2] == pytest.approx(0.3 * (414.285714 - 300), rel=5e-3)
    assert tool.external_work == pytest.approx(300 * 0.0470476 * np.pi / 2 * 20 / 2, rel=1e-4)
    assert tool.elastic_energy == pytest.approx(tool.external_work, rel=1e-12)
    # the planes of symmetry hold the quarter against the pressure on its projection
    assert tool.reaction(side(tool.body.nodes.mesh, 0, 0.0)) == pytest.approx([-300 * 20, 0], rel=1e-6, abs=1e-6)


def test_errors_of_displacement_and_stress_have_their_orders():
    """Energy-consistent displacements of order 3 or better at the bore, stresses carried to the nodes of order 2."""
    sizes, shifts, stresses = [], [], []
    for n in (4, 8, 16):
        tool = lame(n)
        radius, u = radial(tool)
        hoop = 57.142857 * (1 + 2500 / radius**2)
        hoop_found = np.einsum("ni,ni->n", tool.stress[:, [1, 0]], tool.x**2) / radius**2 \
            - 2 * tool.stress[:, 3] * tool.x[:, 0] * tool.x[:, 1] / radius**2
        sizes.append(1 / n)
        shifts.append(np.abs(u[np.isclose(radius, 20)] - 0.04704762).max())
        stresses.append(np.sqrt(np.mean((hoop_found - hoop) ** 2)))
    assert (observed_orders(sizes, shifts) > 3).all(), shifts
    assert (observed_orders(sizes, stresses) > 1.8).all(), stresses


@pytest.mark.parametrize("kind, bending", [("plane_stress", 2.380952), ("plane_strain", 2.166667)])
def test_cantilever_bends_as_a_beam_with_shear(kind, bending, verified):
    """REFERENCES.md 6.9, 1 %: 100 x 20 x 1 mm, 1000 N at the end as the shear stress of the beam, bending + shear."""
    mesh = meshing.rectangle((0, -10), (100, 10), (20, 6))
    root, end = side(mesh, 0, 0.0), side(mesh, 0, 100.0)

    def shear(x):
        return np.stack([0 * x[:, 1], -1.5 * 1000 / 20 * (1 - (x[:, 1] / 10) ** 2)], axis=1)

    tool = ff.solve_tool(mesh, kinematics=kind, material=STEEL, held=[FixedDisplacement(root, i) for i in (0, 1)],
                         loads=[ff.Traction(end, shear)])
    at_end = np.isclose(tool.x[:, 0], 100) & np.isclose(tool.x[:, 1], 0)
    verified("6.9", f"deflection, {kind.replace('_', ' ')}", -tool.displacement[at_end, 1].item(), bending + 0.074286,
             within=1e-2, unit="mm")
    assert tool.reaction(root) == pytest.approx([0, 1000], abs=1e-6)
    middle = np.isclose(tool.x[:, 0], 50) & np.isclose(tool.x[:, 1], 10)
    assert tool.stress[middle, 0] == pytest.approx(1000 * 50 * 10 / (20**3 / 12), rel=5e-3)  # M y / I, far from both ends


@pytest.mark.parametrize("kind", ["plane_stress", "axisymmetric"])
def test_spinning_disk(kind, verified):
    """REFERENCES.md 6.10, a disk of 100 mm at 2000 rad/s: the plane, and a thin axisymmetric disk with free faces."""
    spin = ff.Centrifugal(density=7.85e-9, speed=2000)
    if kind == "plane_stress":
        mesh = quarter_disk(100, 8)
    else:
        mesh = meshing.rectangle((0, 0), (100, 1), (24, 1))
    tool = ff.solve_tool(mesh, kinematics=kind, material=STEEL, held=symmetric(mesh, 0, 1), loads=[spin])
    radius = np.hypot(*tool.x.T)
    centre, rim = np.isclose(radius, 0), np.isclose(tool.x, [100, 0]).all(axis=1)
    assert tool.stress[centre, 0] == pytest.approx(129.525, rel=5e-3)
    verified("6.10", f"stress at the centre, {kind.replace('_', ' ')}", tool.stress[centre, 0].mean(), 129.525, within=5e-3,
             unit="MPa")
    verified("6.10", f"displacement of the rim, {kind.replace('_', ' ')}", tool.displacement[rim, 0].item(), 0.0261667,
             within=1e-3, unit="mm")


def quarter_disk(radius, n):
    """A quarter disk from a square: squares about the corner become circles; its diagonal is one of sides of cells."""
    mesh = meshing.rectangle((0, 0), (1, 1), (n, n))
    x = mesh.geometry.x[:, :2]
    r, below = x.max(axis=1), x[:, 0] >= x[:, 1]
    share = np.divide(x.min(axis=1), r, out=np.zeros_like(r), where=r > 0)
    angle = np.where(below, np.pi / 4 * share, np.pi / 2 - np.pi / 4 * share)
    on_axis = x == 0
    x[:] = radius * np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)
    x[on_axis] = 0.0
    return mesh


# ---------------------------------------------------------------------- patch test and invariance
def uniform(kind):
    """Gradient of a displacement of uniform strain, (dim, dim); in axisymmetry radial stretch and axial stretch."""
    if kind == "axisymmetric":
        return np.diag([1e-3, -2e-3])
    return 1e-3 * np.array([[1.0, 0.5, -0.2], [0.3, -2.0, 0.4], [0.6, 0.1, 0.7]])[: 3 if kind == "3d" else 2,
                                                                                 : 3 if kind == "3d" else 2]


@pytest.mark.parametrize("kind", KINDS)
def test_patch_of_irregular_cells_takes_a_uniform_strain_exactly(kind):
    """Displacements given on the boundary: inside linear, stress uniform and Hooke's, to rounding."""
    mesh, gradient = block(kind), uniform(kind)
    every = meshing.exterior_facets(mesh)
    held = [FixedDisplacement(every, i, lambda x, i=i: x @ gradient[i]) for i in range(len(gradient))]
    tool = ff.solve_tool(mesh, kinematics=kind, material=STEEL, held=held)
    across = {"plane_stress": -0.3 / 0.7 * np.trace(gradient), "axisymmetric": 1e-3}.get(kind, 0.0)
    strain = np.zeros((3, 3))
    strain[: len(gradient), : len(gradient)] = (gradient + gradient.T) / 2
    if kind != "3d":
        strain[2, 2] = across
    stress = STEEL.lame * np.trace(strain) * np.eye(3) + 2 * STEEL.shear_modulus * strain
    names = {"rr": (0, 0), "zz": (2, 2), "tt": (2, 2), "rz": (0, 1), "xx": (0, 0), "yy": (1, 1), "yz": (1, 2),
             "xz": (0, 2), "xy": (0, 1)} | ({"zz": (1, 1)} if kind == "axisymmetric" else {})
    expected = [stress[names[c]] for c in tool.components]
    assert tool.displacement == pytest.approx(tool.x @ gradient.T, abs=1e-14)
    assert tool.stress == pytest.approx(np.broadcast_to(expected, tool.stress.shape), abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_pressure_all_around_is_a_hydrostatic_stress(kind):
    """The other half of the patch test, by forces: a uniform pressure on every face."""
    mesh = block(kind)
    facets = meshing.exterior_facets(mesh)
    dim = mesh.topology.dim
    corner = (1.0, 0.0) if kind == "axisymmetric" else (0.0,) * dim
    held = {"axisymmetric": [FixedPoint(corner, 1)],
            "3d": [FixedPoint((0, 0, 0), i) for i in range(3)] + [FixedPoint((1, 0, 0), 1), FixedPoint((1, 0, 0), 2),
                                                                 FixedPoint((0, 1, 0), 2)]}.get(
        kind, [FixedPoint((0, 0), 0), FixedPoint((0, 0), 1), FixedPoint((1, 0), 1)])
    tool = ff.solve_tool(mesh, kinematics=kind, material=STEEL, held=held, loads=[Pressure(facets, 100)])
    normal = 2 if dim == 2 and kind != "axisymmetric" else 3
    assert tool.stress[:, :normal] == pytest.approx(np.full((len(tool.x), normal), -100), abs=1e-7)
    assert np.abs(tool.reactions).max() < 1e-7 * 100, "forces in balance by themselves need no support"


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_motion_of_the_supports_adds_itself_and_no_stress(kind):
    """Translation and small rotation; in axisymmetry along the axis only."""
    mesh = block(kind)
    dim = mesh.topology.dim
    low, high = side(mesh, dim - 1, 0.0), side(mesh, dim - 1, 1.0)
    turn = np.zeros((dim, dim))
    if kind != "axisymmetric":
        turn = 1e-2 * np.array([[0, -1, 0.5], [1, 0, -0.3], [-0.5, 0.3, 0]])[:dim, :dim]
    shift = np.array([0.0, 0.3]) if kind == "axisymmetric" else 0.1 * np.arange(1, dim + 1)

    def solve(motion):
        held = [FixedDisplacement(low, i, lambda x, i=i: motion(x)[:, i]) for i in range(dim)]
        return ff.solve_tool(mesh, kinematics=kind, material=STEEL, held=held, loads=[Pressure(high, 50)])

    still, moved = solve(lambda x: 0 * x), solve(lambda x: x @ turn.T + shift)
    assert moved.displacement == pytest.approx(still.displacement + moved.x @ turn.T + shift, abs=1e-12)
    assert moved.stress == pytest.approx(still.stress, abs=1e-7)


# ---------------------------------------------------------------------- loads and supports
@pytest.mark.parametrize("kind", KINDS)
def test_weight_stands_on_its_support(kind):
    """Force balance of a body force, and a vertical stress that grows with the depth under free sides (mean of a face)."""
    mesh = block(kind)
    last = mesh.topology.dim - 1
    force = [0.0] * (last + 1)
    force[last] = -7.0
    tool = ff.solve_tool(mesh, kinematics=kind, material=STEEL, loads=[ff.BodyForce(tuple(force))],
                         held=[FixedDisplacement(side(mesh, last, 0.0), i) for i in range(last + 1)])
    volume = np.pi * (4 - 1) if kind == "axisymmetric" else 1.0
    assert tool.body.volumes.sum() == pytest.approx(volume, rel=1e-10)
    assert tool.reaction(side(mesh, last, 0.0))[last] == pytest.approx(7.0 * volume, rel=1e-10)


def test_block_on_springs_sinks_by_pressure_over_stiffness():
    """Foundation along the normal and springs along the axis act alike on a flat face, and share the load if both act."""
    mesh = meshing.rectangle((0, 0), (2, 1), (4, 2))
    low, high = side(mesh, 1, 0.0), side(mesh, 1, 1.0)
    sinks = []
    for springs in ([ff.Springs(low, 500.0)], [ff.Springs(low, 500.0, 1)],
                    [ff.Springs(low, 200.0), ff.Springs(low, 300.0, 1)]):
        tool = ff.solve_tool(mesh, kinematics="plane_stress", material=STEEL, springs=springs, loads=[Pressure(high, 100)],
                             held=symmetric(mesh, 0))
        on_springs = np.isclose(tool.x[:, 1], 0)
        sinks.append(tool.displacement[on_springs, 1])
        # energies: springs p² A / 2k, material p² V / 2E
        assert tool.spring_energy == pytest.approx(100**2 * 2 / (2 * 500))
        assert tool.elastic_energy == pytest.approx(100**2 * 2 / (2 * 210e3))
        assert tool.external_work == pytest.approx(tool.spring_energy + tool.elastic_energy, rel=1e-12)
    for sink in sinks:
        assert sink == pytest.approx(np.full_like(sink, -100 / 500), rel=1e-10)


def test_point_springs_carry_what_the_lever_says():
    """A bar on two springs under a force off its middle: the springs take the force in the ratio of the arms."""
    mesh = meshing.rectangle((0, 0), (10, 1), (10, 1))
    springs = ff.PointSprings([(0, 0), (10, 0)], 40.0, 1)
    quarter = meshing.boundary_facets(mesh, lambda x: np.isclose(x[1], 1) & (x[0] > 1.99) & (x[0] < 3.01))
    tool = ff.solve_tool(mesh, kinematics="plane_stress", material=STEEL, springs=[springs],
                         held=[FixedPoint((0, 0), 0)], loads=[Pressure(quarter, 80)])
    for end, part in ((0, 0.75), (10, 0.25)):
        at = np.isclose(tool.x, [end, 0]).all(axis=1)
        assert -40 * tool.displacement[at, 1] == pytest.approx(80 * part, rel=1e-9)
    assert tool.external_work == pytest.approx(tool.spring_energy + tool.elastic_energy, rel=1e-10)


def test_nodal_forces_of_a_pressure_are_the_pressure():
    """What a contact operator hands over, forces at nodes, acts as the traction that they come from."""
    mesh = ring_sector(20, 50, 4, 4)
    body = ToolBody(Nodes(mesh), kinematics="axisymmetric", material=STEEL, held=symmetric(mesh, 0, 1))
    load = Pressure(at_radius(mesh, 20), lambda x: 100 + x[:, 1])
    forces = body.nodal_forces(body.external_forces([load]))
    solver = ElasticSolver(body)
    solver.solve([load])
    by_pressure = body.nodal()
    solver.solve([ff.NodalForces(forces)])
    assert body.nodal() == pytest.approx(by_pressure, rel=1e-12, abs=1e-16)


# ---------------------------------------------------------------------- economy
def test_elastic_tool_is_factorised_once_and_superposes():
    """Any number of load cases, one factorisation; the sum of two cases is the case of the sum."""
    mesh = ring_sector(20, 50, 4, 4)
    body = ToolBody(Nodes(mesh), kinematics="plane_strain", material=STEEL, held=symmetric(mesh, 0, 1))
    solver = solver_of(body)
    inner, outer = Pressure(at_radius(mesh, 20), 300), Pressure(at_radius(mesh, 50), 100)
    found = []
    for loads in ([inner], [outer], [inner, outer]):
        solver.solve(loads)
        found.append(body.nodal())
    assert solver.factor.factorisations == 1
    assert found[2] == pytest.approx(found[0] + found[1], abs=1e-14)


def test_tool_that_cannot_yield_has_no_plastic_state():
    """Absent, not zero; and a yield stress that is never reached changes no stress."""
    mesh = ring_sector(20, 50, 4, 4)

    def solve(material):
        return ff.solve_tool(mesh, kinematics="plane_strain", material=material, held=symmetric(mesh, 0, 1),
                             loads=[Pressure(at_radius(mesh, 20), 300)])

    elastic, strong = solve(STEEL), solve(STEEL.replaced(yield_stress=1e4))
    assert isinstance(elastic.solver, ElasticSolver) and isinstance(strong.solver, PlasticSolver)
    assert elastic.plastic_strain is None and elastic.solver.plastic is None
    assert strong.iterations == 1 and strong.solver.factor.factorisations == 1
    assert strong.plastic_strain.max() == 0
    assert strong.stress == pytest.approx(elastic.stress, abs=1e-8)


def test_two_materials_share_a_load_by_their_stiffness():
    """Two layers under one strain: each has its modulus times it."""
    mesh = meshing.rectangle((0, 0), (2, 1), (4, 4))
    nodes = Nodes(mesh)
    middles = nodes.x[mesh.geometry.dofmap[:, :3]].mean(axis=1)
    soft = STEEL.replaced(young=70e3)
    parts = [(STEEL, np.flatnonzero(middles[:, 0] < 1)), (soft, np.flatnonzero(middles[:, 0] > 1))]
    tool = ff.solve_tool(mesh, kinematics="plane_stress", material=parts,
                         held=[*symmetric(mesh, 0, 1), FixedDisplacement(side(mesh, 1, 1.0), 1, -1e-3)])
    for x, law in ((0.5, STEEL), (1.5, soft)):
        at = np.isclose(tool.x, [x, 0.5]).all(axis=1)
        assert tool.stress[at, 1] == pytest.approx(-1e-3 * law.young, rel=1e-9)


@pytest.mark.parametrize("kind, axes, springs, free", [
    ("plane_strain", (), (), "3 ways"), ("plane_strain", (0,), (), "1 way"), ("plane_strain", (0,), (1,), None),
    ("axisymmetric", (0,), (), "1 way"), ("axisymmetric", (1,), (), None),
    ("3d", (0, 1), (), "1 way"), ("3d", (0,), (2,), "1 way"), ("3d", (0, 1, 2), (), None)])
def test_tool_that_may_drift_is_refused(kind, axes, springs, free):
    """An error that counts the free motions, not displacements of 1e10 mm; symmetry planes hold what they must.

    A plane x = 0 leaves the motion along y in the plane; in space, with springs along z, that along y.
    """
    mesh = meshing.box((0, 0, 0), (1, 1, 1), (1, 1, 1)) if kind == "3d" else meshing.rectangle((0, 0), (2, 1), (4, 2))
    last = mesh.topology.dim - 1
    case = {"kinematics": kind, "material": STEEL, "held": symmetric(mesh, *axes),
            "springs": [ff.Springs(side(mesh, axis, 0.0), 10.0) for axis in springs],
            "loads": [Pressure(side(mesh, last, 1.0), 10)]}
    if free is None:
        ff.solve_tool(mesh, **case)
    else:
        with pytest.raises(ff.ConvergenceError, match=f"free to move as a whole in {free}:"):
            ff.solve_tool(mesh, **case)
