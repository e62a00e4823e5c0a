"""A mesh seen by its nodes: averages, reductions, orientation, splitting of corner cells."""

import subprocess
import sys
import textwrap

import basix
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from fenics_forming import meshing
from fenics_forming.physics import gmsh_arrays
from fenics_forming.physics.conditions import facet_nodes
from fenics_forming.physics.nodes import EDGES, Nodes

ALONE = MPI.COMM_SELF


def regular(dim, n=3):
    if dim == 2:
        return Nodes(meshing.rectangle((0, 0), (2, 1), (n, n)))
    return Nodes(meshing.box((0, 0, 0), (2, 1, 1), (n, n, n)))


def irregular(dim, n=3):
    """Vertices moved about, mid-nodes half-way again: cells of unequal size around every vertex."""
    nodes = regular(dim, n)
    x = nodes.x
    inner = np.ones(len(x), dtype=bool)
    for k in range(dim):
        inner &= (x[:, k] > 1e-9) & (x[:, k] < x[:, k].max() - 1e-9)
    x[inner] += np.random.default_rng(0).uniform(-0.2, 0.2, (inner.sum(), dim)) / n
    nodes.with_mids(x)
    return nodes


def quadratic_map(x):
    """A smooth map whose components are quadratic: P2 geometry carries it exactly."""
    moved = x.copy()
    moved[:, 0] += 0.1 * x[:, -1] ** 2 + 0.05 * x[:, 0] * x[:, -1]
    moved[:, -1] += 0.2 * x[:, 0] - 0.03 * x[:, 0] ** 2
    return moved


DIMENSIONS = pytest.mark.parametrize("dim", [2, 3])


# ---------------------------------------------------------------------- averages
@DIMENSIONS
def test_vertex_mean_reproduces_linear_fields(dim):
    """Scalars, vectors and tensors, at vertices and mid-nodes, on cells of unequal size."""
    nodes = irregular(dim)
    linear = 1 + nodes.x @ np.arange(1.0, dim + 1)
    assert nodes.vertex_mean(linear[nodes.vertices]) == pytest.approx(linear, rel=1e-14)
    tensor = linear[:, None, None] * np.arange(dim * dim).reshape(dim, dim)
    assert nodes.vertex_mean(tensor[nodes.vertices]) == pytest.approx(tensor, rel=1e-14)


@DIMENSIONS
def test_vertex_mean_weighs_cells_by_their_volume(dim):
    """A value for each cell: the mean at a vertex is the volume-weighted one of its cells."""
    nodes = irregular(dim)
    values = np.random.default_rng(1).uniform(size=len(nodes.cells))
    mean = nodes.vertex_mean(np.repeat(values[:, None], dim + 1, axis=1))
    for vertex in nodes.vertices[5, :2]:
        around = (nodes.vertices == vertex).any(axis=1)
        assert mean[vertex] == pytest.approx(np.average(values[around], weights=nodes.cell_sizes()[around]), rel=1e-13)


def gradient_error(dim, n):
    """Greatest error of the recovered gradient of a smooth field: of all nodes, of those on the boundary."""
    nodes = irregular(dim, n)
    V = fem.functionspace(nodes.mesh, ("Lagrange", 2))
    u = fem.Function(V)
    u.interpolate(lambda x: np.sin(x[0]) * np.exp(x[1]) + np.cos(2 * x[dim - 1]))
    corners = basix.geometry(nodes.mesh.basix_cell())
    at_vertices = fem.Expression(ufl.grad(u), corners).eval(nodes.mesh, np.arange(len(nodes.cells), dtype=np.int32))
    found = nodes.vertex_mean(at_vertices.reshape(-1, dim + 1, dim))
    x, y = nodes.x[:, 0], nodes.x[:, 1]
    exact = np.zeros((nodes.count, dim))
    exact[:, 0], exact[:, 1] = np.cos(x) * np.exp(y), np.sin(x) * np.exp(y)
    exact[:, -1] -= 2 * np.sin(2 * nodes.x[:, -1])
    error = np.abs(found - exact).max(axis=1)
    on_boundary = facet_nodes(nodes, meshing.exterior_facets(nodes.mesh))
    return error.max(), error[on_boundary].max(), error[~nodes.is_vertex].max()


@pytest.mark.parametrize(("dim", "sizes"), [(2, (8, 16, 32)), (3, (3, 6, 12))])
def test_recovered_gradient_is_of_second_order_at_every_node(dim, sizes):
    """Of a P2 field, whose gradient is linear in each cell: on the boundary and at mid-nodes as well."""
    errors = np.array([gradient_error(dim, n) for n in sizes])
    orders = np.log2(errors[:-1] / errors[1:])
    # 1.7 to 2.1 measured in the maximum norm, on meshes that are random anew at every size
    assert (orders > 1.6).all(), orders


@DIMENSIONS
def test_mid_nodes_get_the_mean_of_the_ends_of_their_edge(dim):
    nodes = irregular(dim)
    values = np.random.default_rng(2).uniform(size=(nodes.count, 2))
    filled = nodes.with_mids(values.copy())
    assert (filled[nodes.is_vertex] == values[nodes.is_vertex]).all()
    for cell in nodes.cells:
        for k, (a, b) in enumerate(EDGES[dim]):
            assert filled[cell[dim + 1 + k]] == pytest.approx(0.5 * (values[cell[a]] + values[cell[b]]), rel=1e-15)
    assert np.allclose(nodes.with_mids(nodes.x.copy()), nodes.x, atol=1e-15), "straight sides: where they are"


def test_sum_on_one_rank_leaves_vertices_alone_whatever_the_width():
    nodes = regular(2)
    for shape in ((), (3,), (2, 2)):
        values = np.random.default_rng(3).uniform(size=(nodes.count, *shape))
        summed = nodes.sum_over_ranks(values)
        assert summed.shape == values.shape and (summed[nodes.is_vertex] == values[nodes.is_vertex]).all()


# ---------------------------------------------------------------------- sizes and orientation
@DIMENSIONS
def test_cell_sizes_add_up_to_the_body_and_extents_bound_it(dim):
    nodes = irregular(dim)
    assert nodes.cell_sizes().sum() == pytest.approx(2.0, rel=1e-14)
    assert nodes.extents() == pytest.approx(np.array([[0] * dim, [2] + [1] * (dim - 1)]), abs=1e-15)


@DIMENSIONS
def test_smallest_jacobian_is_that_of_the_cell_map(dim):
    """Twice the area of a triangle, six times the volume of a tetrahedron; scaling tells the unit."""
    nodes = regular(dim)
    assert nodes.smallest_jacobian() == pytest.approx(2 / 3**dim, rel=1e-12)
    nodes.x[:] *= 10
    assert nodes.smallest_jacobian() == pytest.approx(10**dim * 2 / 3**dim, rel=1e-12)


@DIMENSIONS
def test_smallest_jacobian_of_an_inverted_cell_is_negative(dim):
    """A vertex that goes through the opposite side, and a side that bends through its whole cell."""
    for move in ("vertex", "mid-node"):
        nodes = regular(dim)
        cell = nodes.cells[4]
        if move == "vertex":
            opposite = nodes.x[cell[1:dim + 1]].mean(axis=0)
            nodes.x[cell[0]] += 1.2 * (opposite - nodes.x[cell[0]])
            nodes.with_mids(nodes.x)
        else:
            assert 0 not in EDGES[dim][0]
            nodes.x[cell[dim + 1]] = nodes.x[cell[0]]       # the side opposite to the first vertex bends through it
        assert nodes.smallest_jacobian() < 0, move


def test_mirrored_mesh_is_not_taken_for_inverted():
    """Orientation is relative to the mesh at the start."""
    mesh = meshing.rectangle((0, 0), (1, 1), (2, 2))
    mesh.geometry.x[:, 0] *= -1
    assert Nodes(mesh).smallest_jacobian() > 0


def test_straight_mesh_is_refused():
    with pytest.raises(ValueError, match="order 2"):
        Nodes(dmesh.create_unit_square(ALONE, 1, 1))


@DIMENSIONS
def test_facet_nodes_are_all_nodes_on_the_facets(dim):
    """Vertices and mid-nodes of one side: (2n+1) or (2n+1)² of them; none for no facet."""
    nodes = regular(dim)
    found = facet_nodes(nodes, meshing.boundary_facets(nodes.mesh, lambda x: np.isclose(x[0], 0)))
    assert set(found) == set(np.flatnonzero(np.isclose(nodes.x[:, 0], 0)))
    assert len(found) == 7 ** (dim - 1)
    assert len(facet_nodes(nodes, np.empty(0, np.int32))) == 0


# ---------------------------------------------------------------------- corner cells
def sides_on_boundary(cells, dim):
    """Number of exterior sides of every cell."""
    sides = np.sort(np.stack([np.delete(cells[:, : dim + 1], i, axis=1) for i in range(dim + 1)], axis=1), axis=2)
    _, inverse, counts = np.unique(sides.reshape(-1, dim), axis=0, return_inverse=True, return_counts=True)
    return (counts[inverse.ravel()] == 1).reshape(-1, dim + 1).sum(axis=1)


@pytest.mark.parametrize("curved", [False, True])
@DIMENSIONS
def test_splitting_corner_cells_keeps_the_body_and_leaves_one_side_each(dim, curved):
    """Same volume (curved sides too), conforming quadratic cells, positive Jacobians, at most one exterior side."""
    nodes = regular(dim, 2)
    if curved:
        nodes.x[:] = quadratic_map(nodes.x)
    x, cells = nodes.x.copy(), np.asarray(nodes.cells)
    assert sides_on_boundary(cells, dim).max() > 1, "the regular mesh has such cells"
    new_x, new_cells = gmsh_arrays.split_corner_cells(x, cells, dim)
    assert sides_on_boundary(new_cells, dim).max() == 1
    split = Nodes(meshing.distributed(lambda: (new_x, new_cells), dim, ALONE))
    assert split.smallest_jacobian() > 0
    volume = [fem.assemble_scalar(fem.form(1.0 * ufl.dx(domain=n.mesh))) for n in (nodes, split)]
    assert volume[1] == pytest.approx(volume[0], rel=1e-13)
    # one centre and its spokes for each cell that was cut, no node twice: conforming
    cut = int((sides_on_boundary(cells, dim) > 1).sum())
    assert len(new_cells) == len(cells) + dim * cut and len(new_x) == len(x) + (dim + 2) * cut
    assert len(split.x) == len(new_x)
    boundary = [len(meshing.exterior_facets(n.mesh)) for n in (nodes, split)]
    assert boundary[0] == boundary[1]
    if not curved:
        assert np.allclose(split.with_mids(split.x.copy()), split.x, atol=1e-14), "mid-nodes belong to their edges"


@DIMENSIONS
def test_splitting_a_cell_with_a_bulging_side_keeps_its_orientation(dim):
    """A side that curves far into its cell: the new nodes follow the cell's own map, whose Jacobian stays positive."""
    kind = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}[dim]
    element = basix.create_element(basix.ElementFamily.P, kind, 2, basix.LagrangeVariant.gll_warped)
    x, cells = element.points.copy(), np.arange(len(element.points))[None]
    for k, edge in enumerate(EDGES[dim]):
        if 0 not in edge:       # the sides of the face opposite to vertex 0 bend towards it
            x[dim + 1 + k] *= 0.72
    cell, split = (Nodes(meshing.distributed(lambda body=body: body, dim, ALONE))
                   for body in ((x, cells), gmsh_arrays.split_corner_cells(x, cells, dim)))
    assert cell.smallest_jacobian() > 0.1, "the cell itself is sound"
    assert len(split.cells) == dim + 1 and split.smallest_jacobian() > 0.1 / (dim + 1)


def test_mesh_without_corner_cells_is_left_alone():
    nodes = regular(2, 2)
    once = gmsh_arrays.split_corner_cells(nodes.x, np.asarray(nodes.cells), 2)
    twice = gmsh_arrays.split_corner_cells(*once, 2)
    assert twice[0] is once[0] and twice[1] is once[1]


TWO_RANKS = """
    import numpy as np
    from fenics_forming import meshing
    from fenics_forming.physics.nodes import Nodes
    from fenics_forming.physics.parallel import highest, lowest, total
    for dim in (2, 3):
        n = 4
        mesh = meshing.rectangle((0, 0), (2, 1), (n, n)) if dim == 2 else meshing.box((0, 0, 0), (2, 1, 1), (n, n, n))
        nodes = Nodes(mesh)
        linear = 1 + nodes.x @ np.arange(1.0, dim + 1)
        assert np.abs(nodes.vertex_mean(linear[nodes.vertices]) - linear).max() < 1e-13
        # every vertex collects as many ones as it has cells, on whichever ranks they are
        ones = np.bincount(nodes.vertices.ravel(), minlength=nodes.count).astype(float)
        cells = nodes.sum_over_ranks(ones)
        high = np.array([2.0] + [1.0] * (dim - 1))
        inside = nodes.is_vertex & ((nodes.x > 1e-9) & (nodes.x < high - 1e-9)).all(axis=1)
        assert inside.any() and (cells[inside] == {2: 6, 3: 24}[dim]).all(), cells[inside]
        assert abs(total(nodes.comm, nodes.cell_sizes().sum()) - 2) < 1e-13
        assert np.abs(nodes.extents() - [[0] * dim, [2] + [1] * (dim - 1)]).max() < 1e-15
        rank = nodes.comm.rank
        assert (lowest(nodes.comm, rank), highest(nodes.comm, rank), total(nodes.comm, 1)) == (0, 1, 2)
        assert (total(nodes.comm, np.array([1.0, rank])) == [2, 1]).all()
"""


@pytest.mark.mpi
def test_averages_and_reductions_are_the_same_on_two_ranks(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(textwrap.dedent(TWO_RANKS))
    run = subprocess.run(["mpirun", "-n", "2", sys.executable, script], capture_output=True, text=True, timeout=900)
    assert run.returncode == 0, run.stderr
