"""Contact: facet integrals, the law of one point, tools in motion, and what one velocity solve makes of them."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from fenics_forming import FixedVelocity, NewtonSettings, kinematics, laws, meshing
from fenics_forming.physics.contact import point_law
from fenics_forming.physics.contact.facets import ContactFacets
from fenics_forming.physics.contact.rigid import KnownTool, RigidContact, ToolMotion
from fenics_forming.physics.contact.surfaces import Plane
from fenics_forming.physics.newton import FlowSolver
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.workpiece import Workpiece

KINDS = ["plane_strain", "axisymmetric", "3d"]
ROUND_OFF = 1e-13


def body(kind, n=2):
    """Nodes of the unit square or cube, away from the axis in axisymmetry."""
    if kind == "3d":
        return Nodes(meshing.box((0, 0, 0), (1, 1, 1), (n, n, n)))
    return Nodes(meshing.rectangle((1, 0), (2, 1), (n, n)))


def bent(nodes):
    """Move all nodes, mid-nodes too, by a smooth map that curves every side."""
    x = nodes.x.copy()
    nodes.x[:, 0] += 0.2 * x[:, -1] ** 2
    nodes.x[:, -1] += 0.1 * np.sin(2 * x[:, 0])
    return nodes


def all_facets(nodes, kind):
    return ContactFacets(nodes, kinematics.KINDS[kind], meshing.exterior_facets(nodes.mesh))


# ---------------------------------------------------------------------- facet integrals
@pytest.mark.parametrize("move", ["as meshed", "bent"])
@pytest.mark.parametrize("kind", KINDS)
def test_facet_integral_is_the_sum_of_traction_and_weight_over_the_points(kind, move):
    """The virtual power that UFL assembles and the forces that are summed in numpy are one and the same."""
    nodes = body(kind)
    facets = all_facets(nodes, kind)
    if move == "bent":
        bent(nodes)
        facets.follow()
    dim = nodes.dim
    random = np.random.default_rng(1)
    traction, tangent = random.standard_normal((facets.count, dim)), random.standard_normal((facets.count, dim, dim))
    facets.set_traction(traction, tangent)
    V = fem.functionspace(nodes.mesh, ("Lagrange", 2, (dim,)))
    weight = kinematics.KINDS[kind].weight(ufl.SpatialCoordinate(nodes.mesh))
    w, u = fem.Function(V), fem.Function(V)
    # any linear field: its trace is the same whichever way it is interpolated
    A, B = random.standard_normal((2, dim, dim))
    w.interpolate(lambda x: A @ x[:dim] + 1)
    u.interpolate(lambda x: B @ x[:dim] - 2)
    at_points = facets.trace(nodes.x)
    # the isoparametric P2 interpolant of a linear field is that field on curved cells too
    w_points, u_points = at_points @ A.T + 1, at_points @ B.T - 2
    power = fem.assemble_scalar(fem.form(facets.virtual_power(w, weight), entity_maps=facets.entity_maps))
    slope = fem.assemble_scalar(fem.form(facets.tangent(u, w, weight), entity_maps=facets.entity_maps))
    weights = facets.weights()
    summed = -np.einsum("pi,pi,p->", traction, w_points, weights)
    summed_slope = np.einsum("pij,pi,pj,p->", tangent, w_points, u_points, weights)
    scale = np.einsum("p,pi->", weights, np.abs(traction))
    assert power == pytest.approx(summed, abs=ROUND_OFF * scale)
    assert slope == pytest.approx(summed_slope, abs=20 * ROUND_OFF * scale)


@pytest.mark.parametrize("kind", KINDS)
def test_facet_integral_of_a_moved_body_needs_follow(kind):
    """The submesh has a geometry of its own; the weights that are summed must be those of the moved body."""
    nodes = body(kind)
    facets = all_facets(nodes, kind)
    before = facets.weights().sum()
    nodes.x[:] *= 1.5
    facets.follow()
    grown = 1.5 ** (nodes.dim - 1) * (1.5 if kind == "axisymmetric" else 1.0)
    assert facets.weights().sum() == pytest.approx(grown * before, rel=ROUND_OFF)
    assert np.ptp(facets._sub.geometry.x, axis=0).max() == pytest.approx(1.5)


@pytest.mark.parametrize("kind", KINDS)
def test_trace_reproduces_quadratic_fields(kind):
    """Nodal values are those of P2: constants, linear and quadratic fields are exact, on straight cells."""
    nodes = body(kind)
    facets = all_facets(nodes, kind)
    points = facets.trace(nodes.x)

    def field(x):
        return 3 + x @ np.arange(1, nodes.dim + 1) + x[:, 0] * x[:, -1] - 2 * x[:, 0] ** 2

    assert facets.trace(field(nodes.x)) == pytest.approx(field(points), rel=ROUND_OFF)
    both = np.stack([field(nodes.x), nodes.x[:, 0] ** 2], axis=1)
    assert facets.trace(both) == pytest.approx(np.stack([field(points), points[:, 0] ** 2], axis=1), rel=ROUND_OFF)


AREAS = {"plane_strain": 4.0, "axisymmetric": 2 * np.pi * (1 + 2) + 2 * np.pi * (2**2 - 1**2), "3d": 6.0}


@pytest.mark.parametrize("kind", KINDS)
def test_weights_add_up_to_the_surface_of_the_body(kind):
    """Perimeter of the square, surface of the cube, and of the ring with its 2 pi r."""
    assert all_facets(body(kind), kind).weights().sum() == pytest.approx(AREAS[kind], rel=ROUND_OFF)


@pytest.mark.parametrize(("kind", "exact"), [("plane_strain", np.pi), ("axisymmetric", 4 * np.pi)])
def test_weights_of_a_round_body_converge_with_order_4(kind, exact):
    """Half circle (arc pi) or, turned about its axis, a sphere (surface 4 pi), on sides with curved mid-nodes."""
    errors = []
    for n in (4, 8, 16):
        nodes = Nodes(meshing.rectangle((0.5, -np.pi / 2), (1, np.pi / 2), (1, n)))
        r, turn = nodes.x.T.copy()
        nodes.x[:] = np.stack([r * np.cos(turn), r * np.sin(turn)], axis=1)
        outer = meshing.boundary_facets(nodes.mesh, lambda x: np.isclose(np.hypot(x[0], x[1]), 1))
        errors.append(ContactFacets(nodes, kinematics.KINDS[kind], outer).weights().sum() / exact - 1)
    # quadratic sides: length to order 4, 4.0 measured
    assert (np.diff(np.log(np.abs(errors))) / np.log(0.5) > 3.8).all(), errors


def test_smoothing_keeps_linear_pressures_and_the_total_force():
    """Nodal means of hats reproduce a constant, and never lose force: sum of hat weights is the weight."""
    nodes = body("axisymmetric", 3)
    facets = all_facets(nodes, "axisymmetric")
    weights = facets.weights()
    assert facets.smooth(np.full(facets.count, 7.0), weights) == pytest.approx(7.0, rel=ROUND_OFF)
    pressure = np.random.default_rng(2).uniform(0, 100, facets.count)
    assert facets.smooth(pressure, weights) @ weights == pytest.approx(pressure @ weights, rel=ROUND_OFF)


@pytest.mark.parametrize("kind", ["plane_strain", "3d"])
def test_linear_part_keeps_linear_pressures_and_the_force_of_every_facet(kind):
    nodes = body(kind)
    facets = all_facets(nodes, kind)
    points = facets.trace(nodes.x)
    linear = 5 + points @ np.arange(1, nodes.dim + 1)
    assert facets.linear_part(linear) == pytest.approx(linear, rel=ROUND_OFF)
    rough = np.random.default_rng(3).uniform(0, 1, facets.count)
    w = facets.weights()
    by_facet = [(v * w).reshape(-1, facets.points_per_facet).sum(axis=1) for v in (rough, facets.linear_part(rough))]
    assert by_facet[1] == pytest.approx(by_facet[0], rel=1e-12)
    assert not np.allclose(facets.linear_part(rough), rough)


# ---------------------------------------------------------------------- one point
def states(dim, count=200, seed=4):
    """Points with random gaps, normals and tool velocities."""
    random = np.random.default_rng(seed)
    state = point_law.PointState.at_rest(count, dim)
    state.gap = random.uniform(-0.2, 0.5, count)
    normal = random.standard_normal((count, dim))
    state.normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    state.tool_velocity = random.standard_normal((count, dim))
    state.grip = np.ones(count)
    return state, random.standard_normal((count, dim))


@pytest.mark.parametrize("dim", [2, 3])
def test_pressure_never_pulls_and_follows_its_formula(dim):
    """p = <lambda + C (c_n - g/dt)>+ with c_n the closing speed; an open point carries nothing."""
    state, v = states(dim)
    state.multiplier = 3.0 * state.normal
    C, dt = 50.0, 0.1
    point_law.normal_pressure(state, v, C, dt)
    closing = ((v - state.tool_velocity) * -state.normal).sum(axis=1)
    expected = 3.0 + C * (closing - state.gap / dt)
    assert state.pressure == pytest.approx(np.maximum(expected, 0.0), abs=1e-11)
    assert 0 < state.active.sum() < len(state.active), "the sample has both open and closed points"
    traction, tangent = point_law.normal_response(state, C)
    assert (traction[~state.active] == 0).all() and (tangent[~state.active] == 0).all()
    along = (traction * state.normal).sum(axis=1)
    assert (along >= 0).all(), "the tool pushes along its outward normal"
    assert np.linalg.norm(traction, axis=1) == pytest.approx(along, abs=1e-10), "no tangential part"


def test_normal_tangent_is_minus_the_derivative_of_the_traction():
    state, v = states(3)
    C, dt, step = 50.0, 0.1, 1e-6
    along = np.random.default_rng(5).standard_normal(v.shape)
    point_law.normal_pressure(state, v, C, dt)
    _, tangent = point_law.normal_response(state, C)
    away_from_kink = np.abs(state.pressure) + ~state.active > 1e-3
    found = []
    for sign in (1, -1):
        point_law.normal_pressure(state, v + sign * step * along, C, dt)
        found.append(point_law.normal_response(state, C)[0])
    difference = -(found[0] - found[1]) / (2 * step)
    exact = np.einsum("pij,pj->pi", tangent, along)
    # piecewise linear: only rounding over the step remains
    assert difference[away_from_kink] == pytest.approx(exact[away_from_kink], abs=1e-6)


def test_point_that_presses_by_rounding_stays_as_it_is():
    state = point_law.PointState.at_rest(4, 3)
    state.gap, state.normal = np.zeros(4), np.tile([0.0, 0.0, 1.0], (4, 1))
    state.active = np.array([True, False, True, False])
    velocity = np.outer([1e-15, -1e-15, 1e-3, -1e-3], [0.0, 0.0, 1.0])       # out of the tool where positive
    point_law.normal_pressure(state, velocity, 700.0, 0.1, speed=2.0)
    np.testing.assert_array_equal(state.active, [True, False, False, True])
    np.testing.assert_allclose(state.pressure, [0.0, 0.0, 0.0, 0.7], atol=1e-9)


@pytest.mark.parametrize("depth", [0.0, 0.03, -0.03])
def test_point_that_reaches_the_tool_within_the_step_lands_on_it_as_the_penalty_grows(depth):
    """Mass point under a steady force against a tool at rest: the gap left after the step is force/C·dt."""
    dt, damping, force = 0.1, 1.0, 10.0   # c v = F - p, free speed 10 mm/s: reaches 1 mm
    left = []
    for C in (1e2, 1e4, 1e6):
        state = point_law.PointState.at_rest(1, 2)
        state.gap, state.normal = np.array([depth]), np.array([[0.0, 1.0]])
        v = 0.0
        for _ in range(5):   # Newton; the law is linear once the point is closed
            point_law.normal_pressure(state, np.array([[0.0, v]]), C, dt)
            slope = C if state.active[0] else 0.0
            v += (-force + state.pressure[0] - damping * v) / (damping + slope)
        left.append(depth + v * dt)
    # the gap at the end is -(F - c v)/C dt: it falls as 1/C
    assert np.abs(left[1:]) == pytest.approx(np.abs(left[:-1]) / 100, rel=0.02)
    assert abs(left[-1]) < 2e-6


@pytest.mark.parametrize("dim", [2, 3])
def test_friction_opposes_the_slip_and_stays_below_its_limit(dim):
    """t = -limit v_s/|v_s|, |v_s|² = v_s² + v0²: never above the limit, along -v_s, nothing along the normal."""
    state, v = states(dim)
    state.slip = point_law.slip_velocity(state, v)
    limit = np.random.default_rng(6).uniform(0, 20, len(v))
    traction, _ = point_law.friction_response(state, limit, 0.05)
    size = np.linalg.norm(traction, axis=1)
    assert (size <= limit * (1 + ROUND_OFF)).all() and (size > 0.5 * limit)[limit > 0].any()
    speed = np.linalg.norm(state.slip, axis=1)
    assert (traction * state.slip).sum(axis=1) == pytest.approx(-size * speed, rel=1e-12), "exactly against the slip"
    assert (traction * state.normal).sum(axis=1) == pytest.approx(0.0, abs=1e-12 * limit.max())
    assert (state.slip * state.normal).sum(axis=1) == pytest.approx(0.0, abs=1e-14)
    assert ((-traction * (v - state.tool_velocity)).sum(axis=1) >= 0).all(), "friction takes power, it gives none"


def test_open_contact_has_no_friction_and_half_grip_half_of_it():
    state, v = states(2)
    state.slip = point_law.slip_velocity(state, v)
    limit = np.full(len(v), 10.0)
    full, _ = point_law.friction_response(state, limit, 0.05)
    state.grip = np.where(np.arange(len(v)) % 2, 0.5, 0.0)
    part, tangent = point_law.friction_response(state, limit, 0.05)
    assert part == pytest.approx(state.grip[:, None] * full, rel=1e-14)
    assert (tangent[state.grip == 0] == 0).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_dual_friction_tangent_is_the_derivative_where_stress_and_slip_are_consistent(dim):
    """With s = limit v_s/|v_s| the stress-velocity tangent must be Newton's; central differences tell."""
    state, v = states(dim)
    limit, slip0, step = np.full(len(v), 10.0), 0.3, 1e-6
    along = np.random.default_rng(7).standard_normal(v.shape)

    def traction(velocity):
        state.slip = point_law.slip_velocity(state, velocity)
        return point_law.friction_response(state, limit, slip0)[0]

    difference = -(traction(v + step * along) - traction(v - step * along)) / (2 * step)
    state.friction_stress = -traction(v)
    _, tangent = point_law.friction_response(state, limit, slip0)
    assert np.einsum("pij,pj->pi", tangent, along) == pytest.approx(difference, abs=1e-7)   # step² and rounding
    assert tangent == pytest.approx(tangent.swapaxes(1, 2), abs=1e-14), "symmetric, for the LDL^T"
    # the stress cut to its limit keeps the tangent semi-definite, whatever stress is carried along
    state.friction_stress = 100 * np.random.default_rng(8).standard_normal(v.shape)
    projector = np.eye(dim) - state.normal[:, :, None] * state.normal[:, None, :]
    state.friction_stress = np.einsum("pij,pj->pi", projector, state.friction_stress)
    _, tangent = point_law.friction_response(state, limit, slip0)
    assert np.linalg.eigvalsh(tangent).min() > -1e-10


def test_updated_friction_stress_is_the_linearised_one():
    """s after an increment of the slip is limit v_s/|v_s| of the new slip up to the square of the increment."""
    errors = []
    for step in (2e-3, 1e-3):
        state, v = states(3)
        limit, slip0 = np.full(len(v), 10.0), 0.3
        state.slip = point_law.slip_velocity(state, v)
        state.friction_stress = -point_law.friction_response(state, limit, slip0)[0]
        along = np.random.default_rng(9).standard_normal(v.shape)
        new = point_law.slip_velocity(state, v + step * along)
        point_law.update_friction_stress(state, new, limit, slip0)
        assert (state.slip == new).all()
        errors.append(np.abs(state.friction_stress + point_law.friction_response(state, limit, slip0)[0]).max())
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)   # the next term is of third order


# ---------------------------------------------------------------------- tools in motion
def test_velocity_of_a_rotating_tool_is_the_rate_of_its_material_points():
    """v(x) against central differences of x = c + u + R(angle)(X - c), in the plane and in space."""
    h, omega = 1e-5, 1.7
    for dim in (2, 3):
        random = np.random.default_rng(dim)
        centre, speed, X = random.standard_normal(dim), random.standard_normal(dim), random.standard_normal((20, dim))
        axis = random.standard_normal(3) if dim == 3 else None

        def at(t, speed=speed, centre=centre, axis=axis):
            return ToolMotion(t * speed, speed, 0.3 + omega * t, omega, centre, axis)

        def position(t, X=X, centre=centre, at=at):
            return centre + at(t).displacement + at(t).turn(X - centre)

        t = 0.4
        x = position(t)
        assert at(t).to_tool(x) == pytest.approx(X, abs=1e-14)
        difference = (position(t + h) - position(t - h)) / (2 * h)
        assert at(t).velocity_at(x) == pytest.approx(difference, abs=1e-8)   # h² and rounding over h


def test_torque_is_the_power_of_the_forces_at_unit_angular_velocity():
    """Sum of f·v for a tool that turns at 1 rad/s in place is the moment about its axis."""
    for dim in (2, 3):
        random = np.random.default_rng(10 + dim)
        points, forces = random.standard_normal((2, 30, dim))
        motion = ToolMotion(random.standard_normal(dim), np.zeros(dim), 0.2, 1.0, random.standard_normal(dim),
                            random.standard_normal(3) if dim == 3 else None)
        power = np.sum(forces * motion.velocity_at(points))
        assert motion.torque(points, forces) == pytest.approx(power, rel=1e-12)
    # and a force of 2 N on an arm of 3 mm, counter-clockwise
    motion = ToolMotion(np.zeros(2), np.zeros(2), centre=np.array([1.0, 0.0]))
    assert motion.torque(np.array([[4.0, 0.0]]), np.array([[0.0, 2.0]])) == 6.0


# ---------------------------------------------------------------------- one velocity solve
TIGHT = NewtonSettings(velocity_tolerance=1e-11, force_tolerance=1e-10)


class Upset:
    """The unit body between two platens, or a mirror plane and a platen, at one instant.

    ``turn`` (2-D) rotates body and tools together; ``drift`` is a velocity that all tools have in addition.
    """

    def __init__(self, kind, friction=None, *, lower=False, settings=TIGHT, turn=0.0, drift=0.0, n=4, slip=1e-3):
        low, high = ((0, 0, 0), (1, 1, 1)) if kind == "3d" else ((0, 0), (1, 1))
        mesh = meshing.box(low, high, (2, 2, 2)) if kind == "3d" else meshing.rectangle(low, high, (n, n))
        last = mesh.topology.dim - 1
        fixed = [FixedVelocity(meshing.boundary_facets(mesh, lambda x, i=i: np.isclose(x[i], 0)), i)
                 for i in range(last + 1) if not (lower and (i == last or kind == "plane_strain"))]
        if turn or np.any(drift):
            fixed = []
        ends = meshing.boundary_facets(mesh, lambda x: np.isclose(x[last], 1) | np.isclose(x[last], 0)
                                       if lower else np.isclose(x[last], 1))
        self.nodes = Nodes(mesh)
        c, s = np.cos(turn), np.sin(turn)
        self.rotation = np.array([[c, -s], [s, c]]) if kind != "3d" else np.eye(3)
        self.nodes.x[:] = self.nodes.x @ self.rotation.T
        up = self.rotation[:, last] if kind != "3d" else np.eye(3)[2]
        drift = np.broadcast_to(drift, up.shape)
        self.tools = [KnownTool("upper", Plane(tuple(up), tuple(-up)), friction,
                                ToolMotion(np.zeros(last + 1), drift - up))]
        if lower:
            self.tools.append(KnownTool("lower", Plane(tuple(0 * up), tuple(up)), friction,
                                        ToolMotion(np.zeros(last + 1), drift + 0 * up)))
        self.contact = RigidContact(ContactFacets(self.nodes, kinematics.KINDS[kind], ends), self.tools,
                                    slip_regularisation=slip)
        self.body = Workpiece(self.nodes, kinematics=kinematics.KINDS[kind], flow_stress=laws.NortonHoff(K=100, m=0.2),
                              fixed=fixed, contact=self.contact, settings=settings)
        self.solver, self.last = FlowSolver(self.body), last
        self.top = np.isclose((self.nodes.x @ up), 1)

    def solve(self, times=1):
        """Velocities after so many solves at the same instant; each takes the last traction as its multiplier."""
        for _ in range(times):
            self.contact.search(self.nodes.x, 0.05)
            self.contact.set_speed(1.0)
            self.solver.solve(strain=np.zeros(self.nodes.count), characteristic_rate=1.0)
        return self.body.velocity

    def slack(self):
        """Greatest normal velocity of the platen surface relative to the platen, mm/s (the platen has 1 mm/s)."""
        return np.abs(self.body.velocity[self.top, self.last] + 1).max()


@pytest.mark.parametrize("kind", KINDS)
def test_every_further_solve_takes_an_order_off_the_penetration(kind):
    """Augmented multipliers: platen surface and platen reach the same velocity, far below what the penalty leaves."""
    upset = Upset(kind, n=2)
    slack = []
    for _ in range(6):
        upset.solve()
        slack.append(upset.slack())
    ratio = np.array(slack[1:]) / slack[:-1]
    assert (ratio[np.array(slack[:-1]) > 1e-8] < 0.2).all(), slack
    assert slack[-1] < 1e-5, slack


def test_without_augmentation_the_penetration_stays():
    """The other half of the law above: it is the multiplier that removes it, not the further iterations."""
    upset = Upset("plane_strain", settings=NewtonSettings(velocity_tolerance=1e-11, augmented=False))
    slack = []
    for _ in range(2):
        upset.solve()
        slack.append(upset.slack())
    assert slack[1] > 0.9 * slack[0] > 1e-3


@pytest.mark.parametrize("friction", [None, laws.Siebel(factor=0.3), laws.Coulomb(coefficient=0.1), laws.Sticking()],
                         ids=["frictionless", "siebel", "coulomb", "sticking"])
@pytest.mark.parametrize("kind", ["axisymmetric", "3d"])
def test_forces_of_two_platens_cancel(kind, friction):
    """Nothing else holds the body along the axis, so the sum of the forces must vanish."""
    upset = Upset(kind, friction, lower=True)
    upset.solve(2)
    upper, lower = upset.contact.forces()[:, upset.last]
    assert upper < -50 < 50 < lower
    # residual left by a force tolerance of 1e-10
    assert abs(upper + lower) < 1e-8 * lower


@pytest.mark.parametrize("friction", [None, laws.Siebel(factor=0.3), laws.Sticking()],
                         ids=["frictionless", "siebel", "sticking"])
@pytest.mark.parametrize("kind", KINDS)
def test_force_on_the_body_is_opposite_to_the_reaction_of_its_supports(kind, friction):
    """Residual at the fixed velocities = their reaction; with the forces of the tool it sums to zero, axis by axis."""
    upset = Upset(kind, friction)
    upset.solve(2)
    residual = fem_petsc.assemble_vector(upset.body.residual_form).array[upset.body.velocity_dofs]
    force = upset.contact.force(upset.tools[0])
    # the residual is inner minus contact power: at the supports it is the reaction
    assert residual.sum(axis=0)[upset.last] == pytest.approx(-force[upset.last], rel=1e-8)
    free = np.ones(len(residual), dtype=bool)
    for condition in range(upset.last + 1):
        free &= ~np.isclose(upset.nodes.x[:, condition], 0)
    assert np.abs(residual[free]).max() < 1e-7 * np.abs(force).max()


@pytest.mark.parametrize("friction", [laws.Siebel(factor=0.3), laws.Coulomb(coefficient=0.1), laws.Sticking()],
                         ids=["siebel", "coulomb", "sticking"])
@pytest.mark.parametrize("kind", KINDS)
def test_friction_of_a_solve_takes_power_and_stays_below_its_limit(kind, friction):
    upset = Upset(kind, friction)
    v = upset.solve(2)
    powers = upset.contact.powers(v)
    assert powers["friction"] > 0
    # tools = plastic + friction + penalty; the residual is 1e-8, the regularised rate 1.5e-3² does the rest
    assert powers["tools"] == pytest.approx(upset.body.plastic_power() + powers["friction"] + powers["penalty"],
                                            rel=1e-6)
    state, tool = upset.tools[0].state, upset.tools[0]
    tangential = np.linalg.norm(tool.traction - state.pressure[:, None] * state.normal, axis=1)
    floor = upset.solver.settings.regularisation * 1.0
    nodal = upset.body.law(np.zeros(upset.nodes.count), np.maximum(upset.body.nodal_rate(), floor), None)
    sigma = upset.contact.facets.trace(np.broadcast_to(nodal, upset.nodes.count))
    shear = sigma / np.sqrt(3)
    bound = {"siebel": 0.3, "coulomb": 1.0, "sticking": 2.0}[friction.law] * shear
    # the rate of the last iteration but one made the limit: 1e-6
    assert (tangential <= bound * (1 + 1e-5)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_sticking_surface_slips_in_proportion_to_the_regularisation(kind):
    """It moves with the tool but for what the regularisation leaves; without friction it would spread."""
    spread = np.abs(Upset(kind).solve(2)).max(axis=0)[0]
    slips = []
    for regularisation in (1e-2, 1e-3):
        stuck = Upset(kind, laws.Sticking(), slip=regularisation)
        slips.append(np.median(np.abs(stuck.solve(2)[stuck.top, 0])))
    # a median: at the edge the shear stress is singular.  Ratios of 5.7 to 12 measured on these coarse meshes
    assert slips[1] < 1e-3 * spread
    assert 4 < slips[0] / slips[1] < 15


def test_platen_and_body_moved_together_give_the_same_flow():
    """Frame invariance: a steady velocity of all tools adds itself, a rotation of everything rotates the flow."""
    friction = laws.Siebel(factor=0.4)
    still = Upset("plane_strain", friction, lower=True)
    v = still.solve(3)
    for turn, drift in ((0.0, np.array([0.3, -0.7])), (0.6, 0.0), (0.6, np.array([-0.2, 0.4]))):
        moved = Upset("plane_strain", friction, lower=True, turn=turn, drift=drift)
        w = moved.solve(3)
        # 2e-11 measured: rounding; forces of 100 N/mm
        assert w == pytest.approx(v @ moved.rotation.T + drift, abs=1e-8)
        assert moved.contact.forces() == pytest.approx(still.contact.forces() @ moved.rotation.T, abs=1e-6)


TWO_RANKS = """
    import numpy as np
    from fenics_forming import kinematics, meshing
    from fenics_forming.physics.contact.facets import ContactFacets
    from fenics_forming.physics.nodes import Nodes
    cube, square = meshing.box((0, 0, 0), (1, 1, 1), (2, 2, 2)), meshing.rectangle((1, 0), (2, 1), (4, 4))
    # halves of squares of 1/2, sides of 1/4
    for kind, mesh, area, size in (("axisymmetric", square, 12 * np.pi, 0.25), ("3d", cube, 6.0, (1 + 0.5**0.5) / 3)):
        nodes = Nodes(mesh)
        facets = ContactFacets(nodes, kinematics.KINDS[kind], meshing.exterior_facets(mesh))
        weights = facets.weights()
        found = facets.integral(weights[:, None])[0]
        assert abs(found / area - 1) < 1e-12, (kind, found)
        assert abs(facets.size() / size - 1) < 1e-12, (kind, facets.size())
        assert abs(facets.integral((facets.smooth(weights, weights) * weights)[:, None])[0]
                   / facets.integral((weights**2)[:, None])[0] - 1) < 1e-12
        x = nodes.x - nodes.extents()[0]
        on_surface = (np.isclose(x, 0) | np.isclose(x, 1)).any(axis=1) & nodes.is_vertex
        assert (facets.to_nodes(np.ones(facets.count), weights)[on_surface] == 1).all()
"""


@pytest.mark.mpi
def test_surface_is_counted_once_on_two_ranks(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(textwrap.dedent(TWO_RANKS))
    run = subprocess.run(["mpirun", "-n", "2", sys.executable, script], capture_output=True, text=True, timeout=900)
    assert run.returncode == 0, run.stderr


def test_friction_that_is_held_does_not_follow_points_that_open_and_close():
    """Two points, the second of which opens: its grip goes at once, slowly, or not at all."""
    state = point_law.PointState.at_rest(2, 2)
    state.active = np.array([True, True])
    point_law.follow_contact(state, state.active, "new")
    before, state.active = state.active, np.array([True, False])
    point_law.follow_contact(state, before, "held")
    assert state.grip == pytest.approx([1, 1])
    point_law.follow_contact(state, before, "follows")
    assert state.grip == pytest.approx([1, 0.5])
    point_law.follow_contact(state, before, "new")
    assert state.grip == pytest.approx([1, 0])
    state.before = np.array([False, True])          # of the solve before, whatever the iterations of this one have closed
    point_law.follow_contact(state, before, "before")
    assert state.grip == pytest.approx([0, 1])
