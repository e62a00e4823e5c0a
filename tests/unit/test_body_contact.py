"""Contact between bodies of one mesh: opposite forces, no moment, patch test, release, any number of ranks."""

import subprocess
import sys

import dolfinx
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from fenics_forming.physics import meshing
from fenics_forming.physics.contact.bodies import BodyContact
from fenics_forming.physics.contact.capture import CapturingSurface
from fenics_forming.physics.kinematics import KINDS
from fenics_forming.physics.nodes import EDGES, Nodes

SIDE, YOUNG, POISSON, PRESSURE, PENALTY = 10.0, 210e3, 0.3, 100.0, 1e6


class Stack:
    """Two elastic blocks, one on the other, with ``low`` and ``high`` cells along an edge; the lower is the slave."""

    def __init__(self, dim, low, high, element="integration_point", comm=MPI.COMM_WORLD, shift=0.0):
        kind = {2: meshing.rectangle, 3: meshing.box}[dim]
        below = Nodes(kind([0] * dim, [SIDE] * dim, [low] * dim, MPI.COMM_SELF))
        above = Nodes(kind([0] * (dim - 1) + [SIDE], [SIDE] * (dim - 1) + [2 * SIDE], [high] * dim, MPI.COMM_SELF))
        lift = np.append(np.zeros(dim - 1), shift)
        x = np.concatenate([below.x, above.x + lift])
        cells = np.concatenate([below.cells, above.cells + len(below.x)])
        mine = slice(None) if comm.rank == 0 else slice(0)
        self.mesh = meshing.from_arrays(x[mine], cells[mine], comm)
        self.nodes, self.dim, self.comm = Nodes(self.mesh), dim, comm
        self.V = fem.functionspace(self.mesh, ("Lagrange", 2, (dim,)))
        blocks = np.zeros(self.nodes.count, np.int32)
        blocks[self.mesh.geometry.dofmap] = self.V.dofmap.list
        number = self.V.dofmap.index_map.local_to_global(blocks).astype(np.int64)
        self.owned = self.V.dofmap.index_map.size_local * dim
        upper = np.asarray(self.mesh.topology.original_cell_index) >= len(below.cells)
        slave, master = self._sides(SIDE, ~upper), self._sides(SIDE + shift, upper)
        self.contact = BodyContact(self.nodes, KINDS["plane_strain" if dim == 2 else "3d"], slave, master,
                                   dofs=number[:, None] * dim + np.arange(dim), owned=self.owned, element=element)
        self.contact.coefficient = PENALTY

    def _sides(self, height, cells):
        facets = meshing.boundary_facets(self.mesh, lambda x: np.isclose(x[self.dim - 1], height))
        self.mesh.topology.create_connectivity(self.dim - 1, self.dim)
        to_cell = self.mesh.topology.connectivity(self.dim - 1, self.dim)
        return facets[cells[to_cell.array[to_cell.offsets[facets]]]]

    def press(self):
        """Displacements under a pressure on the top, between mirror planes; only contact holds the upper block up."""
        dim, V = self.dim, self.V
        lame, shear = YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON), YOUNG / 2 / (1 + POISSON)
        strain = lambda w: ufl.sym(ufl.grad(w))  # noqa: E731
        self.stress = lambda w: lame * ufl.tr(strain(w)) * ufl.Identity(dim) + 2 * shear * strain(w)
        u, w = ufl.TrialFunction(V), ufl.TestFunction(V)
        top = np.sort(meshing.boundary_facets(self.mesh, lambda x: np.isclose(x[dim - 1], 2 * SIDE)))
        tags = dolfinx.mesh.meshtags(self.mesh, dim - 1, top, np.ones(len(top), np.int32))
        ds = ufl.Measure("ds", domain=self.mesh, subdomain_data=tags)(1)
        A = fem_petsc.assemble_matrix(fem.form(ufl.inner(self.stress(u), strain(w)) * ufl.dx))
        A.assemble()
        b = fem_petsc.assemble_vector(fem.form(-PRESSURE * w[dim - 1] * ds))
        b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        U = fem.Function(V)
        self.contact.search(self.nodes.x, 1.0)
        self.contact.respond(U.x.petsc_vec, touching=1e-6)
        A.axpy(1.0, self.contact.tangent(), structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        held = [fem.locate_dofs_topological(V, dim - 1, meshing.boundary_facets(
            self.mesh, lambda x, a=a: np.isclose(x[a], 0.0))) * dim + a for a in range(dim)]
        held = np.unique(np.concatenate(held))
        rows = (held[held < self.owned] + V.dofmap.index_map.local_range[0] * dim).astype(np.int32)
        A.zeroRowsColumns(rows, diag=1.0)
        b.setValues(rows, np.zeros(len(rows)))
        b.assemble()
        solver = PETSc.KSP().create(self.comm)
        solver.setOperators(A)
        solver.setType("preonly")
        solver.getPC().setType("lu")
        solver.getPC().setFactorSolverType("mumps")
        solver.solve(b, U.x.petsc_vec)
        U.x.scatter_forward()
        self.contact.respond(U.x.petsc_vec)
        return U

    def stress_error(self, U):
        """Deviation of the normal stress from the pressure, relative: root of the mean square over both blocks."""
        off = (self.stress(U)[self.dim - 1, self.dim - 1] / -PRESSURE - 1) ** 2
        mean = self.comm.allreduce(fem.assemble_scalar(fem.form(off * ufl.dx))) / (2 * SIDE**self.dim)
        return np.sqrt(mean)


def vector_of(stack, field):
    """Unknowns whose nodal values are field(x (n, dim))."""
    U = fem.Function(stack.V)
    U.interpolate(lambda x: field(x[: stack.dim].T).T)
    return U.x.petsc_vec


@pytest.mark.parametrize("dim, low, high", [(2, 5, 3), (2, 3, 5), (3, 3, 2)])
@pytest.mark.parametrize("element", ["integration_point", "node"])
def test_forces_on_the_two_bodies_are_opposite_and_have_no_moment(dim, low, high, element):
    """B sums to zero row by row, and normal forces act along the line from a point to its foot."""
    stack = Stack(dim, low, high, element)
    stack.contact.search(stack.nodes.x, 1.0)
    stack.contact.respond(vector_of(stack, lambda x: np.eye(dim)[dim - 1] * np.sin(x[:, :1]) * (2 * SIDE - x[:, -1:])))
    nodal = np.zeros((stack.nodes.count, dim))
    cells = stack.mesh.geometry.dofmap
    nodal[cells] = stack.contact.forces().array.reshape(-1, dim)[stack.V.dofmap.list]
    size = np.abs(nodal).sum()
    assert size > 0
    assert np.abs(nodal.sum(axis=0)).max() < 1e-13 * size
    x = stack.nodes.x
    moments = [x[:, a] * nodal[:, b] - x[:, b] * nodal[:, a] for a in range(dim) for b in range(a)]
    assert max(abs(m.sum()) for m in moments) < 1e-13 * size * SIDE


@pytest.mark.parametrize("dim", [2, 3])
def test_rigid_motion_of_both_bodies_together_presses_nothing(dim):
    stack = Stack(dim, 3, 2)
    stack.contact.search(stack.nodes.x, 1.0)
    spin = np.zeros((dim, dim))
    spin[0, 1], spin[1, 0] = -1.0, 1.0
    relative = stack.contact.relative(vector_of(stack, lambda x: 3.0 + x @ spin.T))
    assert np.abs(relative).max() < 1e-12 * SIDE


@pytest.mark.parametrize("dim, low, high, element, allowed", [
    (2, 13, 8, "integration_point", 0.001), (3, 4, 3, "integration_point", 0.001),
    (2, 13, 8, "node", 0.05), (3, 4, 3, "node", 0.05)])
def test_patch_test(dim, low, high, element, allowed):
    """REFERENCES 6.3: uniform stress through unlike meshes, where nodal points fail by a few per cent."""
    stack = Stack(dim, low, high, element)
    U = stack.press()
    assert stack.stress_error(U) < allowed
    assert stack.contact.force()[dim - 1] == pytest.approx(-PRESSURE * SIDE ** (dim - 1), rel=1e-9)
    modulus = YOUNG if dim == 3 else YOUNG / (1 - POISSON**2)
    shortening = 2 * SIDE * PRESSURE / modulus + PRESSURE / PENALTY      # and the overlap p/C
    lowest = U.x.array.reshape(-1, dim)[:, dim - 1].min()
    assert lowest == pytest.approx(-shortening, rel=5e-3 if element == "node" else 1e-4)


def test_open_gap_carries_nothing_and_an_overlap_presses():
    apart = Stack(2, 3, 2, shift=0.1)
    for interference, pressed in ((0.0, False), (0.2, True)):
        apart.contact.interference = interference
        apart.contact.search(apart.nodes.x, 1.0)
        apart.contact.respond(vector_of(apart, np.zeros_like))
        assert (apart.contact.force()[1] < 0) == pressed


def test_points_beyond_the_rim_of_the_other_body_stay_open():
    """The upper block is moved aside by half: half of the points are over it."""
    stack = Stack(2, 4, 3)
    x = stack.nodes.x.copy()
    upper = np.asarray(stack.mesh.topology.original_cell_index) >= 2 * 4 * 4
    x[np.unique(stack.nodes.cells[upper]), 0] += 0.5 * SIDE
    stack.contact.search(x, 1.0)
    at = stack.contact.points.trace(x)[:, 0]
    np.testing.assert_array_equal(np.isfinite(stack.contact.point_gap), at > 0.5 * SIDE)


@pytest.mark.parametrize("dim", [2, 3])
def test_diagonal_blocks_are_those_of_the_tangent(dim):
    stack = Stack(dim, 3, 2)
    stack.contact.search(stack.nodes.x, 1.0)
    stack.contact.respond(vector_of(stack, lambda x: 0.0 * x), touching=1e-6)
    first, blocks = stack.contact.diagonal()
    tangent = stack.contact.tangent()
    found = [[[tangent.getValue(dof + i, dof + j) for j in range(dim)] for i in range(dim)] for dof in first]
    assert np.abs(blocks).max() > 0
    np.testing.assert_allclose(blocks, found, atol=1e-12 * np.abs(blocks).max())


@pytest.mark.parametrize("bent", [0.0, 0.02])
def test_products_on_one_rank_are_those_of_the_tangent(bent):
    """Flat surfaces, where one number stands for a block, and bent ones; with unknowns that are given."""
    from fenics_forming.physics.iterative.carried import CarriedProducts

    stack = Stack(3, 3, 2)
    nodes, contact = stack.nodes, stack.contact
    node_of = contact.unknowns[:, 0] // 3       # among those of the unknowns, whose order is not that of the mesh
    places = np.empty((stack.owned // 3, 3))
    places[stack.V.dofmap.list] = nodes.x[stack.mesh.geometry.dofmap]
    contact.free = (np.abs(places[node_of]) > 1e-9).astype(float)
    x = nodes.x + bent * (nodes.x[:, :1] - 0.3 * SIDE) ** 2 / SIDE * [0, 0, 1]
    contact.search(x, 1.0)
    contact.respond(vector_of(stack, lambda x: 1e-3 * np.sin(x[:, ::-1] / SIDE)), touching=1e-6)
    contact._tangent += 0.1 * np.random.default_rng(1).normal(size=contact._tangent.shape) * np.abs(contact._tangent).max()
    products = CarriedProducts(contact.rows, node_of, contact.free)
    assert (products._flat is not None) == (bent == 0.0)
    free = np.ones((stack.owned // 3, 3))
    free[node_of] = contact.free
    u = free * np.random.default_rng(0).normal(size=free.shape)
    vector, out = vector_of(stack, lambda x: 0.0 * x).copy(), np.zeros_like(u)
    vector.array[:] = u.ravel()
    expected = contact.tangent() * vector
    products.add_product(contact.weighted_tangent(), u, out)
    assert (free * out).ravel() == pytest.approx(expected.array, abs=1e-11 * np.abs(expected.array).max())
    blocks, (first, found) = np.zeros((len(u), 9)), contact.diagonal()
    products.add_diagonal(contact.weighted_tangent(), blocks)
    among = free[first // 3, :, None] * free[first // 3, None]
    assert among.reshape(-1, 9) * blocks[first // 3] == pytest.approx(found.reshape(-1, 9), abs=1e-11 * np.abs(found).max())


@pytest.mark.mpi
def test_two_ranks_find_the_same_force_and_shortening():
    code = ("from tests.unit.test_body_contact import Stack; import numpy as np; from mpi4py import MPI; "
            "s = Stack(3, 3, 2); u = s.press(); f = s.contact.force(); "
            "top = MPI.COMM_WORLD.allreduce(float(u.x.array[: s.owned].min()), MPI.MIN); "
            "MPI.COMM_WORLD.rank == 0 and print('found', *f, top)")
    found = []
    for ranks in (1, 2):
        out = subprocess.run(["mpirun", "-n", str(ranks), sys.executable, "-c", code], capture_output=True, text=True,
                             check=True).stdout
        found.append([float(w) for w in out.split("found")[1].split()])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-9 * np.abs(found[0]).max())


@pytest.mark.parametrize("count", [0, 7])
def test_sides_turn_by_what_their_displacements_turn_them_whatever_stretches_them(count):
    """Also on a rank without sides. Least squares: exact for a turning and a stretch of any size on top of one another."""
    from fenics_forming.physics.contact.surface_turn import _own_spins

    random = np.random.default_rng(0)
    x, angles = random.normal(size=(count, 6, 3)), random.normal(size=(count, 3))
    u = np.cross(angles[:, None], x) + random.normal(size=(count, 1, 3)) + 0.3 * (x - x.mean(axis=1, keepdims=True))
    turns = np.stack([np.cross(axis, np.eye(3)).T for axis in np.eye(3)])
    assert _own_spins(x, u, turns) == pytest.approx(angles, abs=1e-12)


def test_a_point_beside_an_edge_meets_the_face_that_it_lies_before_whatever_the_order_of_the_sides():
    """Both faces are equally near. The order of the sides hangs on the number of ranks: two blocks in space, one of which
    slides over the edges of the other, had forces 1e-3 apart on one and two."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, -1], [1, 1, -1]], float)
    vertices = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]])      # a face upwards, one to the right
    ends = np.array(EDGES[2])
    nodes = np.concatenate([corners[vertices], corners[vertices][:, ends].mean(axis=2)], axis=1)
    numbers = np.tile(vertices, (1, 2))
    above, beside = [1.02, 0.3, 0.05], [1.05, 0.6, 0.02]
    for order in ([0, 1, 2, 3], [2, 3, 0, 1], [3, 1, 2, 0]):
        found = CapturingSurface(nodes[order], numbers[order]).capture(np.array([above, beside]))
        np.testing.assert_allclose(found.normal, [[0, 0, 1], [1, 0, 0]], atol=1e-12)
        np.testing.assert_allclose(found.gap, 0.05, rtol=1e-12)
