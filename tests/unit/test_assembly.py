"""Several bodies in one mesh: whose is what, laws by body, the pattern of the matrix follows the pairs."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from fenics_forming import laws, scene
from fenics_forming.errors import SceneError
from fenics_forming.physics import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.parts import DamageByRow, LawsByRow, Parts
from fenics_forming.physics.tracking import MaterialPoints
from fenics_forming.simulation import Simulation


def two_squares():
    """Nodes of a mesh of two squares of side 1, 2 apart, and its parts."""
    pieces = [Nodes(meshing.rectangle([at, 0], [at + 1, 1], [n, n], MPI.COMM_SELF)) for at, n in ((0.0, 2), (2.0, 3))]
    x = np.concatenate([p.x for p in pieces])
    cells = np.concatenate([pieces[0].cells, pieces[1].cells + len(pieces[0].x)])
    nodes = Nodes(meshing.from_arrays(x, cells, MPI.COMM_SELF))
    return nodes, Parts(nodes, ["left", "right"], [len(p.cells) for p in pieces])


def test_cells_nodes_and_facets_belong_to_the_body_where_they_lie():
    nodes, parts = two_squares()
    np.testing.assert_array_equal(parts.of_node, nodes.x[:, 0] > 1.5)
    np.testing.assert_array_equal(parts.of_cell, nodes.x[nodes.vertices].mean(axis=1)[:, 0] > 1.5)
    exterior = meshing.exterior_facets(nodes.mesh)
    assert [len(parts.facets_of(name, exterior)) for name in parts.names] == [8, 12]


def test_a_point_stays_with_its_body_though_the_other_is_nearer():
    nodes, parts = two_squares()
    places = {"left": [(1.6, 0.5)], "right": [(1.6, 0.5)]}
    found = MaterialPoints(nodes, places, cells={name: parts.cells_of(name) for name in places}).places
    np.testing.assert_allclose(found["left"], [(1.0, 0.5)], atol=1e-9)
    np.testing.assert_allclose(found["right"], [(2.0, 0.5)], atol=1e-9)


def test_laws_by_row_are_the_laws_of_the_bodies():
    rng = np.random.default_rng(0)
    rows = rng.integers(0, 2, (30, 3))
    strain, rate = rng.random(rows.shape), rng.random(rows.shape) + 0.1
    first, second = laws.NortonHoff(K=100, m=0.2), laws.Swift(K=200, prestrain=0.1, n=0.3)
    law = LawsByRow([first, second], rows)
    assert law.depends_on_rate and not law.depends_on_temperature
    np.testing.assert_array_equal(law(strain, rate), np.where(rows == 0, first(strain, rate), second(strain, rate)))
    slope = np.where(rows == 0, first.rate_derivative(strain, rate), 0)
    np.testing.assert_array_equal(law.rate_derivative(strain, rate), slope)


def test_only_laws_that_want_a_temperature_get_one():
    rows = np.array([0, 1, 1])
    hot = laws.HenselSpittel(A=1000, m1=-0.0025, m2=0.1, m3=0.1, m4=0, m5=0, m7=0, m8=0, m9=0)
    law = LawsByRow([laws.Constant(value=100), hot], rows)
    ones = np.ones(3)
    found = law(0.1 * ones, ones, np.array([np.nan, 900.0, 1000.0]))
    np.testing.assert_allclose(found[1:], [hot(0.1, 1.0, t) for t in (900.0, 1000.0)])
    assert found[0] == 100


def test_damage_gathers_only_where_a_body_has_a_law():
    rows = np.array([[0, 0], [1, 1]])
    law = DamageByRow([laws.damage.CockcroftLatham(), None], rows)
    np.testing.assert_array_equal(law.rate(np.full((2, 2), 50.0), np.full((2, 2), 100.0)), [[0.5, 0.5], [0, 0]])


# ---------------------------------------------------------------------- a scene of two blocks
def blocks(shift=0.0, **more):
    """Two blocks, one on the other, in plane strain between plates; the upper one is moved aside by ``shift``."""
    def block(low, high, symmetry=()):
        shape = scene.Rectangle(from_=low, to=high)
        return scene.Workpiece(shape=shape, material="m", mesh_size=2.0, symmetry=symmetry)

    return scene.Scene(geometry="plane_strain", materials={"m": scene.Material(flow_stress=laws.Constant(value=100))},
                       workpieces={"low": block((0, 0), (10, 4), ["y"]), "high": block((shift, 4), (10 + shift, 8))},
                       contacts=[scene.Contact(between=("low", "high"), **more)],
                       tools={"upper": scene.Tool(shape=scene.Plane(point=(0, 8), normal=(0, -1)),
                                                  drive=laws.SpeedDrive(velocity=(0, -1)))},
                       steps=scene.Steps(stroke=0.1), stop=scene.Stop(stroke=0.1))


def test_the_matrix_is_made_anew_only_for_pairs_that_it_does_not_hold():
    body = Simulation(blocks()).body
    interfaces, matrix = body.interfaces, body.solver.system.matrix
    conditions = body.workpiece.conditions
    body.search(0.1)
    assert matrix.follow(conditions) and not matrix.follow(conditions)
    x = body.x.copy()
    upper = body.parts.of_node == 1
    body.x[upper, 0] += 1e-3
    body.search(0.1)
    assert not matrix.follow(conditions), "the same sides still meet"
    body.x[upper, 0] += 3.0
    body.search(0.1)
    assert interfaces.has_new_pairs and matrix.follow(conditions)
    body.x[:] = x
    body.x[upper, 1] += 5.0
    body.search(0.1)
    assert not matrix.follow(conditions) and not np.isfinite(interfaces.gaps()["low-high"]).any(), "out of reach: no pairs"


def test_coupled_matrix_is_the_sum_of_bulk_and_contact():
    """On random vectors; rows of mirror planes stay those of the identity."""
    body = Simulation(blocks(friction=laws.Siebel(factor=0.5))).body
    work, matrix = body.workpiece, body.solver.system.matrix
    body.solve(0.0, body.new_history(), 0.1)
    matrix.assemble(work.conditions)
    rng = np.random.default_rng(1)
    vector, both, bulk, between = (matrix.petsc.createVecRight() for _ in range(4))
    vector.array[:] = rng.standard_normal(vector.array.size)
    matrix.petsc.mult(vector, both)
    matrix._bulk.petsc.mult(vector, bulk)
    body.interfaces.contacts[0].tangent().mult(vector, between)
    assert between.norm() > 0
    assert (both - bulk - between).norm() < 1e-12 * both.norm()
    np.testing.assert_array_equal(between.array[work.fixed_dofs], 0.0)
    assert matrix.petsc.isSymmetric(1e-9 * abs(both.norm(PETSc.NormType.INFINITY)))


def test_bodies_press_on_one_another_as_the_platen_presses():
    run = Simulation(blocks(friction=laws.Siebel(factor=0.5)))
    results = run.run()
    force = results.history.column("force_upper_N_per_mm")
    np.testing.assert_allclose(results.history.column("contact_force_low_high_N_per_mm") / 2, force, rtol=1e-3)
    np.testing.assert_allclose(results.history.column("resultant_low_high_y_N_per_mm"), -force, rtol=1e-3)
    assert run.body.interfaces.forces()[0][1] == pytest.approx(-force[-1] * (1 if run.body.interfaces.slaves["low-high"]
                                                                             == "low" else -1), rel=1e-3)


# ---------------------------------------------------------------------- what is refused, what is warned of
def test_overlap_is_refused_unless_it_is_the_interference():
    with pytest.raises(SceneError, match="overlaps the workpiece 'low'"):
        scene.check(lowered(0.2))
    scene.check(lowered(0.2, interference=0.25))


def lowered(by, **more):
    found = blocks(**more)
    high = found.workpieces["high"].replaced(shape=scene.Rectangle(from_=(0, 4 - by), to=(10, 8)))
    return found.replaced(workpieces={**found.workpieces, "high": high})


@pytest.mark.parametrize("change, key, words", [
    ({"symmetry": ["y"]}, "workpieces.high.symmetry", "a scene has one plane")])
def test_what_several_workpieces_cannot_have(change, key, words):
    found = blocks()
    bodies = {**found.workpieces, "high": found.workpieces["high"].replaced(**change)}
    with pytest.raises(SceneError, match=words) as error:
        scene.check(found.replaced(workpieces=bodies))
    assert error.value.key == key


def test_round_body_and_square_one_may_share_their_mirror_planes():
    """A cylinder is cut through its centre, a block has its low face there."""
    tools = {"upper": scene.Tool(shape=scene.Plane(point=(0, 0, 6), normal=(0, 0, -1)),
                                 drive=laws.SpeedDrive(velocity=(0, 0, -1)))}
    bodies = {"pin": scene.Workpiece(shape=scene.Cylinder(base=(0, 0, 0), axis=(0, 0, 1), radius=3, height=4),
                                     material="m", symmetry=["x", "y", "z"]),
              "cap": scene.Workpiece(shape=scene.Box(from_=(0, 0, 4), to=(4, 4, 6)), material="m", symmetry=["x", "y"])}
    contact = scene.Contact(between=("pin", "cap"))
    found = blocks().replaced(geometry="3d", workpieces=bodies, tools=tools, contacts=[contact])
    assert scene.check(found) == []


def test_bodies_that_touch_without_a_contact_are_warned_of():
    assert scene.check(blocks()) == []
    assert ["they will move through one another" in w for w in scene.check(blocks().replaced(contacts=[]))] == [True]


def test_scene_of_several_bodies_comes_back_from_its_own_text(tmp_path):
    found = blocks(friction=laws.Coulomb(coefficient=0.1), interference=0.01, element="node")
    scene.write_scene(found, tmp_path / "scene.toml")
    assert scene.read_scene(tmp_path / "scene.toml") == found
    assert "low" in str(found) and "between" in str(found)
