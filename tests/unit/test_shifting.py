"""Moving the material: exponential shift, known trajectories, volume-drift laws of the schemes (REFERENCES 2)."""

from types import SimpleNamespace

import numpy as np
import pytest

from fenics_forming import FixedVelocity, NewtonSettings, kinematics, laws, meshing, scene
from fenics_forming.physics.conditions import facet_nodes
from fenics_forming.physics.contact.facets import ContactFacets
from fenics_forming.physics.contact.rigid import KnownTool, RigidContact, ToolMotion
from fenics_forming.physics.contact.surfaces import Plane
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.workpiece import Workpiece
from fenics_forming.process import shifting
from fenics_forming.process.body import FlowingBody
from fenics_forming.process.integration import Etd2, Explicit, Flow, Midpoint, Rotation, Trapezoid
from fenics_forming.process.pace import Pace
from fenics_forming.process.schemes import SCHEMES, scheme_of
from fenics_forming.process.substeps import Substeps
from fenics_forming.process.turning import turn
from fenics_forming.scene import Shifting


def rotation(angle, axis=None):
    if axis is None:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    a = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def points(dim, count=20):
    return np.random.default_rng(dim).uniform(-3, 3, (count, dim))


def in_linear_flow(x, L, dts, centre=0.0, drift=0.0):
    """Positions after etd2 steps in v = L (x - centre) + drift, every step but the first with its memory."""
    memory = None
    for dt in dts:
        v, gradient = (x - centre) @ L.T + drift, np.broadcast_to(L, (len(x), *L.shape))
        new = shifting.etd2(x, v, gradient, dt, memory)
        memory = shifting.FlowMemory(v, gradient, x, dt)
        x = new
    return x


# ---------------------------------------------------------------------- exponential shift
@pytest.mark.parametrize("angle", [1e-8, np.deg2rad(1), np.deg2rad(10), 1.0])
@pytest.mark.parametrize("dim", [2, 3])
def test_etd2_turns_a_rigid_body_exactly(dim, angle):
    """REFERENCES 2.4: three steps of unequal length about a centre away from the origin, up to 1 rad a step."""
    axis = None if dim == 2 else [0.3, -1.0, 0.5]
    L = (rotation(1e-3, axis) - rotation(-1e-3, axis)) / (2 * np.sin(1e-3))   # spin of 1 rad/s
    x, centre = points(dim), np.arange(1.0, dim + 1)
    moved = in_linear_flow(x, L, (angle, 0.5 * angle, 0.7 * angle), centre)
    exact = (x - centre) @ rotation(2.2 * angle, axis).T + centre
    assert moved == pytest.approx(exact, abs=1e-11)
    radius = [np.linalg.norm(y - centre, axis=1) for y in (x, moved)]
    # the series of 14 terms leaves 1/15! of the angle's 14th power
    assert radius[1] == pytest.approx(radius[0], rel=3e-12)


def test_etd2_turns_half_a_revolution_in_one_step_with_more_terms():
    """Any angle: only the length of the series limits the step."""
    x, L = points(2), np.array([[0.0, -1.0], [1.0, 0.0]])
    v, gradient = x @ L.T, np.broadcast_to(L, (len(x), 2, 2))
    assert shifting.etd2(x, v, gradient, np.pi, terms=40) == pytest.approx(-x, abs=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_etd2_is_exact_in_steady_linear_flow_through_a_moving_stream(dim):
    """x' = L x + c has the solution expm(L t) (x + L^-1 c) - L^-1 c, whatever L."""
    from scipy.linalg import expm

    L = np.random.default_rng(20 + dim).uniform(-0.4, 0.4, (dim, dim))
    drift, x = np.arange(1.0, dim + 1), points(dim)
    rest = np.linalg.solve(L, drift)
    moved = in_linear_flow(x, L, (0.5, 0.8, 0.3), drift=drift)
    assert moved == pytest.approx((x + rest) @ expm(1.6 * L).T - rest, abs=1e-12)   # rounding, norm of L below 1


@pytest.mark.parametrize("spin", [0.0, 2.0, 20.0])
def test_etd2_stretches_by_the_exponential_whatever_the_spin(spin):
    """REFERENCES 2.4: rotation with a uniform stretch rate e gives radii exp(e t), independent of the spin."""
    x, L = points(2), 0.3 * np.eye(2) + spin * np.array([[0.0, -1.0], [1.0, 0.0]])
    moved = in_linear_flow(x, L, [0.05] * 20)
    # 20 steps of 1/15!
    assert np.linalg.norm(moved, axis=1) == pytest.approx(np.exp(0.3) * np.linalg.norm(x, axis=1), rel=2e-11)


def ring_error(steps):
    """Error of r² = r0² - 2 c T of a spinning ring with v_r = -c/r after one revolution (REFERENCES 2.4)."""
    spin, c, x, memory = 2 * np.pi, 0.6, np.array([[2.0, 0.0]]), None
    J = np.array([[0.0, -1.0], [1.0, 0.0]])
    dt = 1 / steps
    for _ in range(steps):
        r2 = np.sum(x**2)
        v = spin * x @ J.T - c * x / r2
        L = spin * J - c * (np.eye(2) / r2 - 2 * np.outer(x[0], x[0]) / r2**2)
        new = shifting.etd2(x, v, L[None], dt, memory)
        memory = shifting.FlowMemory(v, L[None], x, dt)
        x = new
    return np.sum(x**2) - (4 - 2 * c)


def test_etd2_grows_a_spinning_ring_with_order_2():
    errors = np.array([ring_error(n) for n in (36, 72, 144)])
    orders = np.log2(np.abs(errors[:-1] / errors[1:]))
    assert (orders > 1.8).all(), errors
    explicit_growth = 4 * ((1 + (2 * np.pi / 36) ** 2) ** 36 - 1)   # of r², REFERENCES 2.4
    assert abs(errors[0]) < 1e-2 * explicit_growth


def upsetting_error(steps, with_memory):
    """Height of a point under a platen that closes from 20 to 10 mm: v = -z/(20 - t), so z = z0 (20 - t)/20."""
    z, dt, memory = np.array([[7.0]]), 10 / steps, None
    for k in range(steps):
        L = np.array([[[-1 / (20 - k * dt)]]])
        v = z * L[0]
        new = shifting.etd2(z, v, L, dt, memory)
        memory = shifting.FlowMemory(v, L, z, dt) if with_memory else None
        z = new
    return z[0, 0] - 3.5


def test_etd2_follows_an_accelerating_flow_with_order_2_by_its_memory():
    """The rate grows as the platen closes; without the unsteady part the shift is of first order (FORMULATION 7)."""
    for with_memory, order in ((True, 2), (False, 1)):
        errors = [upsetting_error(n, with_memory) for n in (40, 80)]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


class Given:
    """A body in a known velocity field, in the form that a time scheme asks for."""

    def __init__(self, x, velocity, gradient):
        self.x, self._velocity, self._gradient = x, velocity, gradient

    def gaps(self):
        return {}

    def solve(self, time, history, dt, *, ahead=1.0, gaps=None):
        return Flow(self._velocity(self.x, time), {}, 1)

    def place(self, time, slack=0.0):
        pass

    def average(self):
        pass

    def velocity_gradient(self):
        return self._gradient(self.x)

    def turn(self, before):
        pass

    def pace(self, at, time, dt):
        return Pace()

    def lapse(self, time, dt, share):
        return share * dt

    def comes_to_rest(self, time, dt):
        return False

    def run(self, scheme, end, steps):
        dt = end / steps
        for k in range(steps):
            scheme.advance(self, self.solve(k * dt, {}, dt), k * dt, {}, dt)
        return self.x


def stagnation():
    L = np.diag([1.0, -1.0])
    return Given(np.array([[1.0, 1.0]]), lambda x, t: x @ L, lambda x: np.broadcast_to(L, (len(x), 2, 2)))


@pytest.mark.parametrize(("steps", "drift"), [(10, -0.095618), (20, -0.048830)])
def test_explicit_shift_drifts_off_the_streamline_of_a_stagnation_flow(steps, drift):
    """REFERENCES 2.2: psi = x y changes by the factor 1 - (T/N)² a step."""
    (x, y), = stagnation().run(Explicit(), 1.0, steps)
    assert x * y - 1 == pytest.approx((1 - 1 / steps**2) ** steps - 1, abs=1e-14)
    assert x * y - 1 == pytest.approx(drift, abs=5e-7)   # digits of the table


@pytest.mark.parametrize("steps", [1, 10])
def test_etd2_follows_the_streamline_of_a_stagnation_flow(steps):
    """REFERENCES 2.2: it arrives at (e, 1/e) in any number of steps."""
    assert stagnation().run(Etd2(), 1.0, steps)[0] == pytest.approx([np.e, 1 / np.e], abs=3e-12)


def test_midpoint_and_trapezoid_follow_a_stagnation_flow_with_their_own_laws():
    """Midpoint: 1 ± dt + dt²/2 a step; trapezoid, converged: (1 ± dt/2)/(1 ∓ dt/2), so x y stays 1."""
    dt = 0.1
    (x, y), = stagnation().run(Midpoint(), 1.0, 10)
    assert (x, y) == pytest.approx(((1 + dt + dt**2 / 2) ** 10, (1 - dt + dt**2 / 2) ** 10), rel=1e-14)
    (x, y), = stagnation().run(Trapezoid(passes=40, tolerance=1e-15), 1.0, 10)
    growth = (1 + dt / 2) / (1 - dt / 2)
    assert (x, y) == pytest.approx((growth**10, growth**-10), rel=1e-13)
    assert x * y == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize(("degrees", "growth"), [(1, 1.056353), (2, 1.115827), (5, 1.314054), (10, 1.716223)])
def test_explicit_shift_blows_up_a_spinning_ring(degrees, growth):
    """REFERENCES 2.4: the radius grows by the root of 1 + (omega dt)² a step; etd2 leaves it alone."""
    J = np.array([[0.0, -1.0], [1.0, 0.0]])

    def ring():
        return Given(np.array([[2.0, 0.0]]), lambda x, t: x @ J.T, lambda x: np.broadcast_to(J, (len(x), 2, 2)))

    radius = np.linalg.norm(ring().run(Explicit(), 2 * np.pi, 360 // degrees)) / 2
    assert radius == pytest.approx(growth, abs=5e-7)   # digits of the table
    assert np.linalg.norm(ring().run(Etd2(), 2 * np.pi, 360 // degrees)) == pytest.approx(2, rel=1e-12)


def test_what_a_solve_starts_from_turns_with_the_body():
    """A rigid body that has turned starts from its rotation where it is now, one between mirror planes from what it had."""
    for mirrors in ((), (0,)):
        nodes = Nodes(meshing.rectangle((0, 0), (10, 20), (2, 3)))
        fixed = [FixedVelocity(meshing.boundary_facets(nodes.mesh, lambda x, i=i: np.isclose(x[i], 0)), i) for i in mirrors]
        workpiece = Workpiece(nodes, kinematics=kinematics.KINDS["plane_strain"], fixed=fixed,
                              flow_stress=laws.Constant(value=100))
        before, spin = nodes.x.copy(), np.array([[0.0, -0.7], [0.7, 0.0]])
        given = (before - [3.0, 4.0]) @ spin.T
        workpiece.set_start(given, np.zeros(nodes.count))
        nodes.x[:] = (before - [3.0, 4.0]) @ rotation(0.3).T + [3.0, 4.0]
        turn(SimpleNamespace(workpiece=workpiece, nodes=nodes, parts=None, x=nodes.x), before)
        expected = given if mirrors else (nodes.x - [3.0, 4.0]) @ spin.T
        assert workpiece.velocity == pytest.approx(expected, abs=1e-12)


# ---------------------------------------------------------------------- volume drift of a real body
TIGHT = NewtonSettings(velocity_tolerance=1e-11, force_tolerance=1e-10)


def between_plane_and_platen(kind="axisymmetric", **platen):
    """The 20 x R10 body (half width 10 in plane strain) between a mirror plane and a platen that comes down 1 mm/s."""
    nodes = Nodes(meshing.rectangle((0, 0), (10, 20), (2, 3)))
    fixed = [FixedVelocity(meshing.boundary_facets(nodes.mesh, lambda x, i=i: np.isclose(x[i], 0)), i) for i in (0, 1)]
    touched = meshing.boundary_facets(nodes.mesh, lambda x: np.isclose(x[1], 20) | np.isclose(x[0], 10))
    kin = kinematics.KINDS[kind]
    contact = RigidContact(ContactFacets(nodes, kin, touched), [KnownTool("platen", Plane((0, 20), (0, -1)), **platen)])
    workpiece = Workpiece(nodes, kinematics=kin, flow_stress=laws.Constant(value=100), fixed=fixed, contact=contact,
                          settings=TIGHT)
    return FlowingBody(workpiece, drives={"platen": laws.SpeedDrive(velocity=(0, -1))}, working_direction=(0, 1),
                       boundary=facet_nodes(nodes, touched))


def upset(scheme, steps, *, kind="axisymmetric", travel=10.0):
    """Volume ratio after each of ``steps`` equal steps of that body, its strain, and the body."""
    body = between_plane_and_platen(kind)
    volume = body.workpiece.volume
    start, history, dt, volumes = volume(), body.new_history(), travel / steps, []
    for _ in range(2):      # the second lets the contact forget the penetration that the first one needed
        flow = body.solve(0.0, history, dt)
    for k in range(steps):
        history, time = scheme.advance(body, flow, k * dt, history, dt).history, (k + 1) * dt
        volumes.append(volume() / start)
        flow = body.solve(time, history, dt)
    return np.array(volumes), history["effective_strain"], body


def discrete_law(scheme, steps, kind, travel=10.0, height=20.0):
    """REFERENCES 2.1: volume ratios of the exact scheme; d and e are die travel over height at start and end."""
    volume, ratios, step = 1.0, [], travel / steps
    share = 1.0 if kind == "plane_strain" else 0.5   # rate of a lateral direction over that of the height
    for _ in range(steps):
        d, e = share * step / height, share * step / (height - step)
        lateral = {"explicit": 1 + d, "midpoint": 1 + d * (1 + d / 2) / (1 - d / 2 / share),
                   "trapezoid": (1 + d / 2) / (1 - e / 2), "rotation": 1 + d + d**2 / 2,
                   "substeps": (1 + d / 3) ** 3}[scheme.name]
        volume *= (1 - step / height) * lateral ** (1 / share)
        height -= step
        ratios.append(volume)
    return np.array(ratios)


DRIFT = {  # REFERENCES 2.1: h 20 to 10, steps: change of volume
    ("explicit", "axisymmetric"): {10: -3.507e-2, 20: -1.813e-2},
    ("midpoint", "axisymmetric"): {10: -8.955e-4, 20: -2.292e-4},
    ("trapezoid", "axisymmetric"): {10: 1.172e-3, 20: 2.930e-4},
    ("explicit", "plane_strain"): {10: -4.545e-2, 20: -2.381e-2},
    ("substeps", "axisymmetric"): {10: -2.782e-2, 20: -1.424e-2},
    ("rotation", "axisymmetric"): {},
}
EXACT = {"explicit": Explicit, "midpoint": Midpoint, "trapezoid": lambda: Trapezoid(passes=60, tolerance=1e-10),
         "substeps": lambda: Substeps(3), "rotation": Rotation}


@pytest.mark.parametrize(("name", "kind"), DRIFT)
def test_volume_drifts_by_the_law_of_the_scheme(name, kind):
    """The die position is exact and the flow homogeneous, so nothing but the discrete law of the scheme remains."""
    ends = []
    for steps in (10, 20):
        scheme = EXACT[name]()
        ratios, _, _ = upset(scheme, steps, kind=kind)
        # the trapezoid's iteration stops at 1e-10 of the size
        assert ratios == pytest.approx(discrete_law(scheme, steps, kind), abs=1e-10)
        table = DRIFT[name, kind].get(steps, ratios[-1] - 1)
        assert ratios[-1] - 1 == pytest.approx(table, abs=6e-4 * abs(table))   # digits of the table
        ends.append(ratios[-1] - 1)
    order = np.log2(ends[0] / ends[1])
    assert order == pytest.approx({"midpoint": 2, "trapezoid": 2}.get(name, 1), abs=0.1)


@pytest.mark.parametrize(("kind", "make"), [("axisymmetric", Etd2), ("plane_strain", Etd2),
                                            ("axisymmetric", lambda: Substeps(1, "midpoint"))])
def test_volume_drift_of_schemes_with_an_unsteady_term_is_of_order_2(kind, make):
    """One solve a step, and yet the drift falls with the square of the step."""
    ends = [upset(make(), steps, kind=kind)[0][-1] - 1 for steps in (10, 20, 40)]
    assert (np.log2(np.divide(ends[:-1], ends[1:])) > 1.8).all(), ends
    # 20 steps: -0.13 % against -1.8 % of the explicit shift
    assert abs(ends[1]) < 0.1 * abs(discrete_law(Explicit(), 20, kind)[-1] - 1)


@pytest.mark.parametrize("name", ["midpoint", "trapezoid", "etd2"])
def test_strain_is_the_logarithm_of_the_height_with_order_2(name):
    """Effective strain ln(h0/h) of homogeneous upsetting at every node: the rate is 1/h at every instant."""
    errors = []
    for steps in (10, 20):
        scheme = EXACT.get(name, Etd2)()
        _, strain, _ = upset(scheme, steps)
        assert np.ptp(strain) < 1e-5, "the flow is homogeneous"
        errors.append(abs(strain.mean() - np.log(2)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.25)


def test_explicit_strain_is_the_sum_of_the_rates_at_the_step_starts():
    _, strain, _ = upset(Explicit(), 10)
    assert strain == pytest.approx(np.sum(1 / np.arange(20.0, 10.0, -1)), abs=1e-6)


def test_platen_nodes_stay_on_the_platen():
    """After every scheme the pressed nodes lie on the platen to rounding, so the die position is exact."""
    for scheme in (Explicit(), Rotation(), Etd2(), Midpoint(rotation=True), Trapezoid(), Substeps(3),
                   Substeps(2, "midpoint", rotation=True)):
        _, _, body = upset(scheme, 5)
        top = body.x[:, 1].max()
        assert top == pytest.approx(10.0, abs=1e-13)
        assert np.sum(np.abs(body.x[:, 1] - top) < 1e-13) == 5, "two sides of a cell: five nodes"


@pytest.mark.parametrize("make", [Etd2, Rotation, lambda: Substeps(2, "midpoint", rotation=True)],
                         ids=["etd2", "rotation", "sub-steps"])
def test_nodes_stay_on_the_mirror_planes_whatever_the_recovered_gradient_says(make):
    """Rough platen: the flow is not homogeneous, and the mean of the gradients of the cells around a node on a mirror plane
    makes velocity across the plane out of velocity along it."""
    body = between_plane_and_platen(friction=laws.Sticking())
    on_plane = body.x == 0.0
    history, scheme = body.new_history(), make()
    for k in range(4):
        history = scheme.advance(body, body.solve(0.5 * k, history, 0.5), 0.5 * k, history, 0.5).history
    assert (body.x[on_plane] == 0.0).all() and np.ptp(history["effective_strain"]) > 0.05


def test_scene_word_implicit_is_the_midpoint_scheme():
    assert SCHEMES["implicit"] is Midpoint


def test_every_scheme_of_a_scene_is_made_with_its_parameters():
    for word in scene.SCHEMES:
        assert scheme_of(Shifting(scheme=word)).name == {"implicit": "midpoint"}.get(word, word)
    found = scheme_of(Shifting(scheme="substeps", substeps=5, rule="midpoint", rotation=True))
    assert (found.count, found.rule, found.rotation) == (5, "midpoint", True)
    assert scheme_of(Shifting(scheme="midpoint", rotation=True)).rotation
    assert not scheme_of(Shifting(scheme="trapezoid")).rotation


# ---------------------------------------------------------------------- nodes and tools
def test_sunken_nodes_go_back_and_pressed_ones_follow_within_reach():
    """Normal projection onto the plane y = 0 below which the tool lies."""
    tool = KnownTool("floor", Plane((0, 0), (0, 1)), motion=ToolMotion(np.zeros(2), np.zeros(2)))
    x = np.array([[0, -0.3], [1, 0.004], [2, 0.004], [3, 0.4], [4, -0.1], [5, 1.0]], float)
    candidates = np.array([0, 1, 2, 3, 5])
    held = {"floor": np.array([False, True, False, True, False, False])}
    depth = shifting.put_on_tools(x, [tool], candidates, held, 0.01)
    assert depth == pytest.approx(0.3)
    # sunken: back; pressed and near: drawn down; near but free, pressed but far, no candidate, free: left alone
    assert x[:, 1] == pytest.approx([0, 0, 0.004, 0.4, -0.1, 1.0], abs=1e-16)
    assert (x[:, 0] == np.arange(6)).all()


def test_body_draws_pressed_nodes_that_hover_onto_the_platen_and_no_others():
    """2e-4 of a facet, 1.2 µm here, is rounding of the shift; a node that is farther off has left the tool."""
    body = between_plane_and_platen()
    body.solve(0.0, body.new_history(), 0.5)
    top = np.isclose(body.x[:, 1], 20)
    for lift, lands in ((1e-4, True), (1e-2, False)):
        body.x[top, 1] = 20 - lift
        body.place(0.0)
        assert (np.abs(body.x[top, 1] - 20) < 1e-13).all() == lands
    # before the first solve nothing is pressed
    body = between_plane_and_platen()
    body.x[top, 1] -= 1e-4
    body.place(0.0)
    assert (body.x[top, 1] < 20 - 1e-5).all()
