"""The compliance of tools, which couples them to workpieces: unit forces, symmetry, tangent of a yielding tool."""

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming import FixedDisplacement, Pressure, laws, meshing
from fenics_forming.physics.conditions import facet_nodes
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.tool_body import (
    ElasticSolver,
    PlasticSolver,
    PointTractions,
    ToolBody,
    ToolSettings,
    global_dofs,
)

from .shapes import side
from .test_tools_elastic import KINDS, STEEL, block

HARDENING = STEEL.replaced(yield_stress=240, hardening=5e3)


def standing(kind, law):
    """A block that stands on its low face, with springs on its high face; the displacements of the nodes there."""
    mesh = block(kind)
    last = mesh.topology.dim - 1
    high = side(mesh, last, 1.0)
    body = ToolBody(Nodes(mesh), kinematics=kind, material=law, springs=[ff.Springs(high, 1e3)],
                    held=[FixedDisplacement(side(mesh, last, 0.0), i) for i in range(last + 1)])
    nodes = facet_nodes(body.nodes, high)
    return body, nodes, global_dofs(body, nodes).ravel()


@pytest.mark.parametrize("kind", KINDS)
def test_compliance_gives_the_displacements_of_any_forces_at_its_nodes(kind):
    body, nodes, dofs = standing(kind, STEEL)
    solver = ElasticSolver(body)
    S = solver.compliance(dofs)
    force = np.zeros((body.nodes.count, body.nodes.dim))
    force[nodes] = np.random.default_rng(2).standard_normal((len(nodes), body.nodes.dim))
    solver.solve([ff.NodalForces(force)])
    assert S @ force[nodes].ravel() == pytest.approx(body.nodal()[nodes].ravel(), abs=1e-12 * np.abs(S).max())
    assert np.linalg.eigvalsh(S).min() > 0, "it can be inverted to the stiffness of the condensed tool"
    assert solver.factor.factorisations == 1


def test_more_columns_than_a_block_and_held_ones():
    """All displacements of a body: the inverse of its stiffness where it is free, zero where it is held."""
    mesh = meshing.rectangle((0, 0), (1, 1), (4, 4))
    body = ToolBody(Nodes(mesh), kinematics="plane_strain", material=STEEL,
                    held=[FixedDisplacement(side(mesh, 1, 0.0), i) for i in (0, 1)])
    dofs = global_dofs(body, np.arange(body.nodes.count)).ravel()
    assert len(dofs) > 2 * 64
    S = ElasticSolver(body).compliance(dofs)
    held = body.is_held.ravel()
    assert np.abs(S[held]).max() == 0 and np.abs(S[:, held]).max() == 0
    assert (np.diag(S)[~held] > 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_tangent_compliance_is_the_derivative_of_the_displacement_by_the_load(kind):
    """Of one load step into the plastic range: differences between steps to slightly different loads."""
    settings = ToolSettings(tolerance=1e-13)
    body, nodes, dofs = standing(kind, HARDENING)
    high = meshing.boundary_facets(body.nodes.mesh, lambda x: np.isclose(x[body.nodes.dim - 1], 1))
    extra = np.zeros((body.nodes.count, body.nodes.dim))
    extra[nodes] = np.random.default_rng(4).standard_normal((len(nodes), body.nodes.dim))
    found = []
    for size in (-1.0, 0.0, 1.0):
        body.displacement.x.array[:] = 0.0
        solver = PlasticSolver(body, settings)
        solver.solve([Pressure(high, 320), ff.NodalForces(1e-4 * size * extra)], steps=1)
        found.append(body.nodal()[nodes].ravel())
        if size == 0.0:
            assert (solver.plastic.effective > 0).mean() > 0.5
            S, elastic = solver.compliance(dofs), ElasticSolver(body).compliance(dofs)
    change = S @ extra[nodes].ravel()
    # displacements of 1e-3 mm balance to 1e-13, over changes of 1e-9 mm
    assert change == pytest.approx((found[2] - found[0]) / 2e-4, abs=1e-4 * np.abs(change).max())
    assert np.linalg.norm(S) > 1.5 * np.linalg.norm(elastic), "a yielding tool gives way more easily"


def test_yielding_tool_that_only_unloads_is_as_stiff_as_an_elastic_one():
    body, nodes, dofs = standing("plane_strain", HARDENING)
    high = side(body.nodes.mesh, 1, 1.0)
    solver = PlasticSolver(body)
    solver.solve([Pressure(high, 320)])
    yielding = solver.compliance(dofs)
    solver.solve([Pressure(high, 300)])
    unloading, elastic = solver.compliance(dofs), ElasticSolver(body).compliance(dofs)
    assert unloading == pytest.approx(elastic, rel=1e-10, abs=1e-15)
    assert np.abs(yielding - elastic).max() > 0.1 * np.abs(elastic).max()


@pytest.mark.parametrize("kind", KINDS)
def test_tractions_given_at_points_keep_force_and_moment(kind):
    """As contact hands them over: their sums by points and those of the nodal forces agree to rounding."""
    body, _, _ = standing(kind, laws.Elasticity(young=1.0, poisson=0.0))
    dim = body.nodes.dim
    facets = meshing.exterior_facets(body.nodes.mesh)
    face = body.face(facets)
    traction = np.random.default_rng(6).standard_normal(face.points.shape)
    nodal = body.nodal_forces(body.external_forces([PointTractions(facets, traction)]))
    forces = traction * face.weights[:, None]
    assert nodal.sum(axis=0) == pytest.approx(forces.sum(axis=0), abs=1e-12 * np.abs(forces).sum())
    moments = [x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0] for x, f in ((body.nodes.x, nodal), (face.points, forces))]
    assert moments[0].sum() == pytest.approx(moments[1].sum(), abs=1e-12 * np.abs(moments[1]).sum())
    assert np.abs(nodal[:, dim - 1]).max() > 0
