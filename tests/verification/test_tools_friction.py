"""Friction between parts of a tool: block, incline, capstan (REFERENCES.md 7), memory of what holds, work, two ranks.

No slip is regularised here: a part holds or slips, so the only error of a limit is that of the solve.
"""

import numpy as np
import pytest

from fenics_forming import ConvergenceError, FixedDisplacement, Pressure, Traction, laws, meshing
from fenics_forming.physics.conditions import facet_nodes
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.tool_body import AssembledSolver, PartContact, ToolBody, ToolSettings, fields
from fenics_forming.physics.tool_body.memory import memory_of, remember

from .shapes import ring_sector, side
from .test_tools_assembled import facing, side_by_side
from .test_tools_elastic import STEEL, at_radius

SOFT = STEEL.replaced(yield_stress=100.0)


def blocks(friction, *, kind="plane_stress", element="integration_point", cells=(4, 6), law=STEEL, height=10.0,
           side_held=True, upper_law=None, pushed=0.04, **numbers):
    """Two blocks 20 x 20 (x 20) mm on one another, the lower one held at its foot, the upper one sideways at its top."""
    dim = 3 if kind == "3d" else 2
    low, high = (np.zeros(dim), np.full(dim, 20.0)), (np.zeros(dim), np.full(dim, 20.0))
    low[1][-1] = height
    high[0][-1], high[1][-1] = height, 2 * height
    make = meshing.box if dim == 3 else meshing.rectangle
    mesh = side_by_side(make(*low, (cells[0],) * (dim - 1) + (2,)), make(*high, (cells[1],) * (dim - 1) + (2,)))
    between = meshing.boundary_facets(mesh, lambda x: np.isclose(x[dim - 1], height))
    upper, lower = facing(mesh, between, lambda x: x[:, dim - 1] > height)
    slave, master = (upper, lower) if cells[1] >= cells[0] else (lower, upper)
    foot, top = side(mesh, dim - 1, 0.0), side(mesh, dim - 1, 2 * height)
    conditions = [FixedDisplacement(foot, i) for i in range(dim)]
    if side_held:
        conditions += [FixedDisplacement(top, i, pushed if i == 0 else 0.0) for i in range(dim - 1)]
    if upper_law is not None:
        above = mesh.geometry.x[mesh.geometry.dofmap[:, : dim + 1], dim - 1].mean(axis=1) > height
        law = [(upper_law, np.flatnonzero(above)), (law, np.flatnonzero(~above))]
    body = ToolBody(Nodes(mesh), kinematics=kind, material=law, held=conditions)
    return AssembledSolver(body, [PartContact(slave, master, friction=friction, element=element)], **numbers), foot, top


def balance(solver):
    """Work that came in and was not stored or dissipated, relative to what came in."""
    found = fields(solver)
    came = solver.external_work + solver.interference_work
    return (came - found.elastic_energy - solver.plastic_work - solver.friction_work) / came


# ---------------------------------------------------------------------- blocks
@pytest.mark.parametrize("element", ["integration_point", "node"])
@pytest.mark.parametrize("kind, cells, force", [("plane_stress", (4, 6), 150.0), ("plane_strain", (6, 4), 150.0),
                                                ("3d", (2, 3), 3000.0)])
def test_block_that_is_pushed_along_needs_the_coefficient_times_its_load(kind, cells, force, element, verified):
    """REFERENCES.md 7: 50 MPa on 20 x 20 mm, coefficient 0.15: 3000 N (150 N/mm), whatever the meshes; before that it holds
    like one piece. All work is stored or lost in friction."""
    solver, foot, top = blocks(laws.Coulomb(coefficient=0.15), kind=kind, cells=cells, element=element)
    solver.solve([Pressure(top, 50)], held=0.0, steps=1)
    pushed = []
    for part in (0.1, 0.5, 1.0):
        solver.solve([Pressure(top, 50)], held=part, steps=2)
        pushed.append(fields(solver).reaction(top)[0])
    assert pushed[1] == pytest.approx(force, rel=1e-4)
    verified("7", f"Coulomb block, body on body, {kind}, {element}", pushed[2], force, within=1e-4, unit="N")
    assert 0 < pushed[0] < force
    contact = solver.contacts[0]
    assert abs(contact.force()[0]) == pytest.approx(force, rel=1e-4)
    assert abs(balance(solver)) < 1e-8


@pytest.mark.parametrize("cells", [(4, 6), (6, 4)], ids=["upper_carries", "lower_carries"])
@pytest.mark.parametrize("stiffer", ["upper", "lower"])
def test_blocks_of_very_unequal_stiffness_slip_at_the_coefficient_times_their_load(stiffer, cells):
    """One block is a hundredth as stiff: the penalty knows the stiffness of both surfaces, whichever carries the points."""
    laws_ = [STEEL, STEEL.replaced(young=2100.0)]
    upper, lower = laws_ if stiffer == "upper" else laws_[::-1]
    solver, _, top = blocks(laws.Coulomb(coefficient=0.15), kind="plane_strain", cells=cells, law=lower, upper_law=upper,
                            pushed=0.4)
    spent = solver.solve([Pressure(top, 5)], held=0.0, steps=1)
    for part in (0.1, 0.5, 1.0):
        spent += solver.solve([Pressure(top, 5)], held=part, steps=2)
    assert fields(solver).reaction(top)[0] == pytest.approx(15.0, rel=1e-3)
    assert abs(balance(solver)) < 1e-3          # sides meet others while they slide
    assert solver.relative_penetration() < 1e-4     # ten multipliers: with friction there are no more
    assert spent < 200


def test_pushed_back_block_holds_until_it_slips_the_other_way():
    """What holds remembers: the force falls from one limit to the other by twice the stiffness of the stuck blocks."""
    solver, _, top = blocks(laws.Coulomb(coefficient=0.15))
    found = []
    for part in (0.0, 1.0, 0.98, 0.5, 0.48):
        solver.solve([Pressure(top, 50)], held=part, steps=1 if part == 0.0 else 4)
        found.append(fields(solver).reaction(top)[0])
    assert [found[1], found[3], found[4]] == pytest.approx([150.0, -150.0, -150.0], rel=1e-4)
    assert -150 < found[2] < 150
    assert abs(balance(solver)) < 1e-9


@pytest.mark.parametrize("coefficient", [0.0, 0.15])
@pytest.mark.parametrize("cells", [(10, 6), (4, 9)])
def test_base_carries_a_sliding_block_where_it_has_come_to(coefficient, cells):
    """A block of 20 mm on a base of 60 mm, pushed 13 mm along it, over several sides of either mesh: moments about the foot
    of the base balance only if points meet the sides that they have come to; at last some slip off its end."""
    friction = laws.Coulomb(coefficient=coefficient) if coefficient else laws.NoFriction()
    mesh = side_by_side(meshing.rectangle((0, 0), (60, 10), (3 * cells[0], 2)),
                        meshing.rectangle((30, 10), (50, 20), (cells[1], 2)))
    between = meshing.boundary_facets(mesh, lambda x: np.isclose(x[1], 10))
    upper, lower = facing(mesh, between, lambda x: x[:, 1] > 10)
    foot, top = side(mesh, 1, 0.0), side(mesh, 1, 20.0)
    held = [FixedDisplacement(foot, 0), FixedDisplacement(foot, 1), FixedDisplacement(top, 0, 13.0)]
    body = ToolBody(Nodes(mesh), kinematics="plane_stress", material=STEEL, held=held)
    slave, master = (upper, lower) if cells[1] >= cells[0] else (lower, upper)
    contacts = [PartContact(slave, master, friction=friction)]
    solver = AssembledSolver(body, contacts)
    solver.solve([Pressure(top, 50)], held=0.0, steps=1)
    centres = []
    for part in (0.25, 0.5, 0.75):      # the last one brings a quarter of a mm short of the end of the base
        solver.solve([Pressure(top, 50)], held=part, steps=4)
        found = fields(solver)
        nodes = facet_nodes(body.nodes, foot)
        reaction = found.reactions[nodes]
        # the base that sinks in tilts by 2e-5; where sides come and leave a carrier may still hold
        assert reaction.sum(axis=0) == pytest.approx([-50 * 20 * coefficient, 1000.0], rel=2e-3, abs=0.03)
        centres.append(body.nodes.x[nodes, 0] @ reaction[:, 1] / 1000.0)
    # pushed at a height of 20 mm, it tips; corners of the block give way by microns
    assert centres == pytest.approx([40 + 13 * part + 20 * coefficient for part in (0.25, 0.5, 0.75)], abs=1e-2)
    # without friction 2 mJ come in, and pushing by the tilt of the base, 0.02 N over 10 mm, is a tenth of that
    assert abs(balance(solver)) < (1e-3 if coefficient else 0.15)
    before, memory = solver.state(), memory_of(solver)
    solver.solve([Pressure(top, 50)], held=1.0, steps=2)
    once = body.nodal()
    solver.go_back(before)
    solver.solve([Pressure(top, 50)], held=1.0, steps=2)
    # multipliers take penetration out to 1e-6 of 13 mm, from where friction is that of a new response
    assert body.nodal() == pytest.approx(once, abs=1e-5)
    again = body.nodal()
    resumed = AssembledSolver(body, contacts)
    remember(resumed, memory)
    resumed.solve([Pressure(top, 50)], held=1.0, steps=2)
    assert body.nodal() == pytest.approx(again, abs=1e-9)


def test_shear_factor_limits_friction_whatever_the_pressure():
    """REFERENCES.md 7: m k = 0.3 * 100 / sqrt(3) = 17.3205 MPa, 346.41 N/mm on 20 mm. At the end that lifts off
    the pressure falls below m k, and friction with it: it never exceeds the pressure."""
    solver, _, top = blocks(laws.Siebel(factor=0.3), law=SOFT, kind="plane_strain", height=2.0)
    solver.solve([Pressure(top, 50)], held=0.0, steps=1)
    solver.solve([Pressure(top, 50)], held=1.0, steps=6)
    contact = solver.contacts[0]
    expected = np.minimum(contact.state.pressure, 17.3205)
    assert np.abs(contact.traction[:, 0]) == pytest.approx(expected, rel=1e-3)
    assert (expected == 17.3205).mean() > 0.8
    assert fields(solver).reaction(top)[0] == pytest.approx(expected @ contact.weights, rel=1e-4)


def test_friction_that_does_not_depend_on_pressure_needs_parts_that_can_yield():
    with pytest.raises(ValueError, match="yield"):
        blocks(laws.Siebel(factor=0.3))


# ---------------------------------------------------------------------- incline
@pytest.mark.parametrize("coefficient, critical", [(0.2, 11.3099), (0.3, 16.6992)])
def test_block_on_an_incline_slides_beyond_the_angle_of_friction(coefficient, critical, verified):
    """REFERENCES.md 7: tan(angle) = coefficient. The load is turned until nothing holds the block any more; steps of a
    thousandth of the way."""
    solver, _, top = blocks(laws.Coulomb(coefficient=coefficient), kind="plane_strain", height=1.0, side_held=False,
                            settings=ToolSettings(steps=8, smallest_step=1e-3))
    solver.solve([Pressure(top, 10)], steps=1)
    with pytest.raises(ConvergenceError):
        solver.solve([Pressure(top, 10), Traction(top, (10 * 0.4, 0))], steps=8)
    verified("7", f"incline, body on body, coefficient {coefficient}", np.degrees(np.arctan(0.4 * solver.reached)),
             critical, within=5e-3, unit="deg")


# ---------------------------------------------------------------------- capstan
PULL = 100.0         # N per mm of thickness, at the end of the belt that is let go
CAPSTAN = [(0.1, 90, 1.170089), (0.3, 90, 1.601911), (0.1, 180, 1.369108), (0.3, 180, 2.566332), (0.1, 360, 1.874456)]


def belt(coefficient: float, degrees: int, drawn: float, around: int = 60):
    """Solver of a belt of 0.5 mm on a drum of radius 50, its far end and where that goes, the drum's inside, and the near
    end."""
    inner, thick, angle, quarters = 50.0, 0.5, np.deg2rad(degrees), degrees // 90
    mesh = side_by_side(ring_sector(40, inner, 3, 24 * quarters, angle),
                        ring_sector(inner, inner + thick, 1, around * quarters, angle))
    slave, drum = facing(mesh, at_radius(mesh, inner), lambda x: np.hypot(*x.T) > inner)
    ends = meshing.boundary_facets(mesh, lambda x: np.isclose(x[1], 0) & (x[0] > inner - 1e-6))
    first, behind = facing(mesh, ends, lambda x: x[:, 1] > 0)
    out, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])    # of the far end
    far = behind if degrees == 360 else meshing.boundary_facets(
        mesh, lambda x: np.isclose(along @ x[:2], 0, atol=1e-6) & (out @ x[:2] > inner - 1e-6))
    axis = int(np.abs(along).argmax())
    inside = at_radius(mesh, 40)
    held = [FixedDisplacement(inside, i) for i in (0, 1)] + [FixedDisplacement(far, axis, drawn * along[axis])]
    body = ToolBody(Nodes(mesh), kinematics="plane_stress", material=STEEL, held=held)
    solver = AssembledSolver(body, [PartContact(slave, drum, friction=laws.Coulomb(coefficient=coefficient))])
    return solver, far, (axis, along[axis]), inside, Traction(first, (0.0, -PULL / thick))


@pytest.mark.parametrize("coefficient, degrees, ratio", [
    pytest.param(*case, marks=pytest.mark.long if case[1] > 90 else ()) for case in CAPSTAN])
def test_belt_around_a_drum_holds_the_more_the_farther_it_reaches(coefficient, degrees, ratio, verified):
    """REFERENCES.md 7, body on body: T2 / T1 = exp(coefficient * angle). The belt carries its tension in its middle, a
    quarter of a per cent farther out than the friction. Its far end is drawn farther than it stretches, so that it slips
    everywhere."""
    solver, far, (axis, sign), _, pull = belt(coefficient, degrees, 0.4 * (degrees // 90))
    solver.solve([pull], held=1.0, steps=8)
    tension = fields(solver).reaction(far)[axis] * sign
    verified("7", f"capstan, body on body, {degrees} degrees, coefficient {coefficient}", tension / PULL, ratio,
             within=1e-2)


def test_belt_that_slides_over_sides_of_the_drum_presses_where_it_has_come_to():
    """A belt drawn by more than half of one of its sides, and stretched by an eighth of that: the ends still pull as they
    are held, in exp(coefficient * angle), and what the drum bears of them has turned as the belt went round it, by the way
    of the far end over the radius less what the belt has been stretched. Tolerance of the ratio as for little ways."""
    drawn, coefficient = 1.0, 0.3
    solver, far, (axis, sign), inside, pull = belt(coefficient, 90, drawn, around=40)
    solver.solve([pull], held=0.0, steps=2)
    solver.solve([pull], held=1.0, steps=8)
    found = fields(solver)
    tension, bears = found.reaction(far)[axis] * sign, found.reaction(inside)
    assert tension / PULL == pytest.approx(np.exp(coefficient * np.pi / 2), rel=1e-2)
    assert np.hypot(*bears) == pytest.approx(np.hypot(tension, PULL), rel=2e-3)
    turned = np.arctan2(*bears[::-1]) - np.arctan2(PULL, tension)
    assert 0.85 * drawn / 50 < turned < drawn / 50


@pytest.mark.parametrize("coefficient, cells", [(0.0, (36, 7)), (0.2, (24, 10))])
def test_drum_carries_a_turning_shoe_where_it_has_come_to(coefficient, cells):
    """A shoe over 40 degrees of a drum, pressed on it and turned with it by 0.15 radian, over several sides of either mesh:
    what the drum bears turns with the shoe, the shoe bears the same in its own frame, and the moment is coefficient times
    radius times the pressures, whose resultant over 40 degrees is 0.9798 of their sum."""
    turn, press, radius = 0.15, 0.02, 50.0
    mesh = side_by_side(ring_sector(40, radius, 2, cells[0], np.pi), ring_sector(radius, 56, 2, cells[1], np.deg2rad(40)))
    upright, x = np.deg2rad(70), mesh.geometry.x
    of_shoe = np.hypot(x[:, 0], x[:, 1]) > radius + 1e-6
    between = at_radius(mesh, radius)
    shoe, drum = facing(mesh, between, lambda x: np.hypot(*x.T) > radius)
    of_shoe |= np.isin(np.arange(len(x)), facet_nodes(Nodes(mesh), shoe))
    x[of_shoe, :2] = x[of_shoe, :2] @ [[np.cos(upright), np.sin(upright)], [-np.sin(upright), np.cos(upright)]]
    inside, outside = at_radius(mesh, 40), at_radius(mesh, 56)
    held = [FixedDisplacement(inside, i) for i in (0, 1)]
    held += [FixedDisplacement(outside, 0, lambda x: -turn * x[:, 1] - press * x[:, 0] / 56),
             FixedDisplacement(outside, 1, lambda x: turn * x[:, 0] - press * x[:, 1] / 56)]
    body = ToolBody(Nodes(mesh), kinematics="plane_stress", material=STEEL, held=held)
    slave, master = (shoe, drum) if 40 / cells[1] <= 180 / cells[0] else (drum, shoe)
    friction = laws.Coulomb(coefficient=coefficient) if coefficient else laws.NoFriction()
    solver = AssembledSolver(body, [PartContact(slave, master, friction=friction)])
    borne = []
    for part in (1 / 3, 2 / 3, 1.0):
        solver.solve(held=part, steps=1)
        reactions = fields(solver).reactions
        forces, moments = [], []
        for facets in (inside, outside):
            nodes = facet_nodes(body.nodes, facets)
            forces.append(reactions[nodes].sum(axis=0))
            moments.append(body.nodes.x[nodes, 0] @ reactions[nodes, 1] - body.nodes.x[nodes, 1] @ reactions[nodes, 0])
        size, (below, above) = np.linalg.norm(forces, axis=1), (np.arctan2(*force[::-1]) for force in forces)
        assert size[0] == pytest.approx(size[1], rel=1e-4)
        assert below - above - np.pi == pytest.approx(part * turn, abs=1e-4)
        leverage = np.array([moments[0], -moments[1]]) / (radius * size * np.cos(np.arctan(coefficient)))
        assert -leverage == pytest.approx(coefficient / 0.9798, rel=0.02, abs=1e-3)
        borne.append((size[0] / part, above))
    sizes, directions = np.array(borne).T
    assert sizes == pytest.approx(3 * [sizes[0]], rel=0.02)
    assert directions == pytest.approx(3 * [directions[0]], abs=5e-3)     # 0.7 % of 40 degrees: ends between points
    if coefficient == 0:
        assert directions[0] == pytest.approx(-np.pi / 2, abs=5e-3)       # friction tips the shoe a little
