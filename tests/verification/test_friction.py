"""Friction through the package (REFERENCES 7): limits of the laws, the regularised slip, a block under a platen."""

import numpy as np
import pytest
from dolfinx.fem import petsc as fem_petsc

from fenics_forming import FixedVelocity, NewtonSettings, kinematics, laws, meshing
from fenics_forming.physics.contact import point_law
from fenics_forming.physics.contact.facets import ContactFacets
from fenics_forming.physics.contact.rigid import KnownTool, RigidContact, ToolMotion
from fenics_forming.physics.contact.surfaces import Plane
from fenics_forming.physics.newton import FlowSolver
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.workpiece import Workpiece

SIDE, DEPTH = 20.0, 20.0      # mm; the block of REFERENCES 7
PRESSURE, STRENGTH = 50.0, 100.0   # MPa


def pressed_block(friction, slip, slip0):
    """Facets of a block whose base slips over a plane at rest, and the force (N) that the plane exerts on all of it.

    The pressure is given, as the multiplier, so no flow is solved: this is the law and the facet sum alone.
    """
    nodes = Nodes(meshing.rectangle((0, 0), (SIDE, SIDE), (4, 4)))
    base = meshing.boundary_facets(nodes.mesh, lambda x: np.isclose(x[1], 0))
    tool = KnownTool("plane", Plane((0, 0), (0, 1)), friction, ToolMotion(np.zeros(2), np.zeros(2)))
    contact = RigidContact(ContactFacets(nodes, kinematics.PLANE_STRAIN, base), [tool], slip_regularisation=1.0)
    contact.coefficient = 1e3
    contact.search(nodes.x, 0.01)
    contact.set_speed(slip0)
    tool.state.multiplier = PRESSURE * tool.state.normal
    velocity = np.tile([slip, 0.0], (nodes.count, 1))
    contact.respond(velocity, flow_stress=np.full(nodes.count, STRENGTH))
    return contact.force(tool) * DEPTH


@pytest.mark.parametrize(("friction", "force"), [
    (laws.Coulomb(coefficient=0.15), 3000.0),
    (laws.Siebel(factor=0.3), 6928.203230),                                                 # 17.3205 MPa
    (laws.Levanov(factor=0.3), 6928.203230 * (1 - np.exp(-1.25 * PRESSURE / STRENGTH))),
], ids=["coulomb", "siebel", "levanov"])
@pytest.mark.parametrize("sense", [1, -1])
def test_sliding_block_feels_the_limit_of_its_law_against_its_slip(friction, force, sense, verified):
    """REFERENCES 7: 20 x 20 mm pressed by 50 MPa, slipping 1e6 times as fast as the regularisation: error 5e-13."""
    found = pressed_block(friction, sense * 1.0, 1e-6)
    assert found[1] == pytest.approx(PRESSURE * SIDE * DEPTH, rel=1e-9)
    # digits of the table
    verified("7", f"sliding block, {friction.law}", -sense * found[0], force, within=1e-9, unit="N")


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0, 100.0, 1000.0])
def test_regularised_friction_is_the_slip_over_its_regularised_size(ratio):
    """|t|/limit = v/root(v² + v0²): 0.7071, 0.99504, 0.99995, ...; closer to 1 than the arctangent of REFERENCES 7."""
    found = pressed_block(laws.Coulomb(coefficient=0.15), ratio, 1.0)
    share = ratio / np.sqrt(1 + ratio**2)
    assert -found[0] / 3000.0 == pytest.approx(share, rel=1e-13)   # nothing but rounding
    arctangent = {10.0: 0.936549, 100.0: 0.993634, 1000.0: 0.999363}
    if ratio in arctangent:
        assert 1 - share < 0.1 * (1 - arctangent[ratio])


def test_sticking_block_is_held_by_a_force_in_proportion_to_its_creep():
    """Below the limit the slip is what balances the load: v = v0 t/root(limit² - t²)."""
    slip0, load = 1e-3, 1800.0
    creep = slip0 * load / np.sqrt(3000.0**2 - load**2)
    assert -pressed_block(laws.Coulomb(coefficient=0.15), creep, slip0)[0] == pytest.approx(load, rel=1e-12)


def test_coulomb_turns_into_full_shear_where_both_meet():
    """REFERENCES 7: mu p = k at p = 577.350 MPa for mu = 0.1, flow stress 100 MPa."""
    law, switch = laws.Coulomb(coefficient=0.1), 577.350269
    below, above = law.limit(0.5 * switch, STRENGTH), law.limit(2 * switch, STRENGTH)
    assert below == pytest.approx(0.05 * switch, rel=1e-12)
    assert above == pytest.approx(STRENGTH / np.sqrt(3), rel=1e-12) == law.limit(9 * switch, STRENGTH)
    assert law.limit(switch, STRENGTH) == pytest.approx(0.1 * switch, rel=1e-9)


def test_incline_angle_of_coulomb_friction_is_the_arctangent_of_its_coefficient():
    """REFERENCES 7: a block under its weight on a slope, tool and gravity turned: tan 11.3099° = 0.2."""
    for coefficient, degrees in ((0.2, 11.3099), (0.3, 16.6992)):
        slope = np.deg2rad(degrees)
        n = np.array([[-np.sin(slope), np.cos(slope)]])
        down = np.array([[-np.cos(slope), -np.sin(slope)]])
        state = point_law.PointState.at_rest(1, 2)
        state.normal, state.grip, state.gap = n, np.ones(1), np.zeros(1)
        weight = np.array([0.0, -5.0])
        state.multiplier = -(weight @ n[0]) * n
        point_law.normal_pressure(state, down, 0.0, 1.0)
        state.slip = point_law.slip_velocity(state, down)
        limit = laws.Coulomb(coefficient=coefficient).limit(state.pressure, np.array([1e3]))
        traction, _ = point_law.friction_response(state, limit, 1e-9)
        # the slope and friction balance: no acceleration along it; six digits of the angle
        assert (weight + traction[0]) @ down[0] == pytest.approx(0.0, abs=1e-5)


# ---------------------------------------------------------------------- a real solve
class SlidingPlaten:
    """A 20 x 20 block on a base that holds it, pressed by a platen that slides along its top.

    The platen goes down at 0.1 mm/s and sideways at 1 mm/s, so that its slip is far above the regularisation
    everywhere and the shear stress on the top is the limit of the law.
    """

    def __init__(self, friction, *, slip=1e-3, kind="plane_strain"):
        mesh = meshing.rectangle((0, 0), (SIDE, SIDE), (6, 6)) if kind == "plane_strain" else \
            meshing.box((0, 0, 0), (SIDE, SIDE, SIDE), (3, 3, 3))
        last = mesh.topology.dim - 1
        nodes, up = Nodes(mesh), np.eye(last + 1)[last]
        top, base = (meshing.boundary_facets(mesh, lambda x, at=at: np.isclose(x[last], at)) for at in (SIDE, 0))
        speed = -0.1 * up
        speed[0] = 1.0
        self.platen = KnownTool("platen", Plane(tuple(SIDE * up), tuple(-up)), friction, ToolMotion(0 * up, speed))
        self.contact = RigidContact(ContactFacets(nodes, kinematics.KINDS[kind], top), [self.platen],
                                    slip_regularisation=slip)
        fixed = [FixedVelocity(base, i) for i in range(last + 1)]
        if kind == "3d":   # between two walls, so that nothing slips across
            walls = meshing.boundary_facets(mesh, lambda x: np.isclose(x[1], 0) | np.isclose(x[1], SIDE))
            fixed.append(FixedVelocity(walls, 1))
        # tighter than 1e-3 and the last point at the trailing corner, which grazes, may open and close for ever
        self.body = Workpiece(nodes, kinematics=kinematics.KINDS[kind], flow_stress=laws.Constant(value=STRENGTH),
                              contact=self.contact, fixed=fixed,
                              settings=NewtonSettings(velocity_tolerance=1e-3, force_tolerance=1e-3))
        solver, self.last = FlowSolver(self.body), last
        for _ in range(3):
            self.contact.search(nodes.x, 1e-2)
            self.contact.set_speed(1.0)
            solver.solve(strain=np.zeros(nodes.count), characteristic_rate=1 / SIDE)

    def forces(self):
        """Force of the platen on the body along its slide, and with which it presses."""
        force = self.contact.force(self.platen)
        return force[0], -force[self.last]

    def base_shear(self):
        """Force of the base on the body along the slide: the residual at its nodes."""
        residual = fem_petsc.assemble_vector(self.body.residual_form).array[self.body.velocity_dofs]
        return residual[np.isclose(self.body.nodes.x[:, self.last], 0), 0].sum()

    def pressed_area(self):
        """Area of the points that the friction acts on, mm² (mm in plane strain)."""
        return self.contact.weights @ self.platen.state.grip

    def slips(self):
        """Slip over the slip regularisation at the points of the platen that press."""
        state = self.platen.state
        return np.linalg.norm(state.slip[state.active], axis=1) / self.contact.slip0


@pytest.mark.parametrize("kind", ["plane_strain", "3d"])
@pytest.mark.parametrize("factor", [0.1, 0.3])
def test_sliding_platen_drags_the_block_with_m_k_times_area(factor, kind):
    """Siebel through a solve: friction force = m k A; 17.3205 MPa on 20 mm for m = 0.3."""
    run = SlidingPlaten(laws.Siebel(factor=factor), kind=kind)
    drag, press = run.forces()
    area = run.pressed_area()
    assert 0.95 < area / SIDE**run.last < 1 + 1e-12, "at most a corner lifts off"
    exact = factor * STRENGTH / np.sqrt(3) * area
    # the regularisation takes 1 - v/root(v² + v0²), v0²/2v²: 6e-7 at v = 0.9, the slowest slip
    slowest = run.slips().min()
    assert slowest > 500
    assert drag == pytest.approx(exact, rel=1 / slowest**2)
    # balance of forces, to the tolerance of the solve
    assert run.base_shear() == pytest.approx(-drag, rel=1e-4), "what drags the top is held at the base"
    assert press > exact


@pytest.mark.parametrize("coefficient", [0.05, 0.15])
def test_sliding_platen_drags_the_block_with_mu_times_its_force(coefficient):
    """Coulomb through a solve: friction force = mu N, whatever the pressure distribution.

    The pressure that friction sees is its nodal mean, which keeps the force.
    """
    run = SlidingPlaten(laws.Coulomb(coefficient=coefficient))
    drag, press = run.forces()
    assert drag < 0.9 * STRENGTH / np.sqrt(3) * SIDE, "below full shear"
    assert drag == pytest.approx(coefficient * press, rel=1e-5)
    assert run.base_shear() == pytest.approx(-drag, rel=1e-4)


def test_error_of_the_friction_force_is_half_the_square_of_the_regularisation_over_the_slip():
    """The error to state for a sliding contact: v0²/2v² of the friction force."""
    exact = 0.1 * STRENGTH / np.sqrt(3) * SIDE
    errors = []
    for regularisation in (0.2, 0.1):
        run = SlidingPlaten(laws.Siebel(factor=0.1), slip=regularisation)
        errors.append(1 - run.forces()[0] / exact)
        # the slip is 1 mm/s within 10 %
        assert errors[-1] == pytest.approx(regularisation**2 / 2, rel=0.2)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
