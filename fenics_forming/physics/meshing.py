"""Meshes of order 2: from gmsh for the shapes of a scene, or raised from any dolfinx mesh."""

from __future__ import annotations

from contextlib import contextmanager

import basix.ufl
import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from dolfinx.io.gmshio import cell_perm_array
from mpi4py import MPI

from ..errors import MeshError
from .nodes import EDGES, QUADRATURE_DEGREE, quadratic_shapes


def order_two(mesh: dmesh.Mesh) -> dmesh.Mesh:
    """An isoparametric mesh of order 2 on the cells of a straight-sided simplex mesh (serial or parallel).

    The mid-nodes lie half-way, so the body is the same; from then on every node may move.
    """
    if mesh.geometry.cmap.degree == 2:
        return mesh
    dim = mesh.topology.dim
    V = fem.functionspace(mesh, ("Lagrange", 2))
    local = mesh.topology.index_map(dim).size_local
    dofs = V.dofmap.list[:local]
    numbers = V.dofmap.index_map.local_to_global(dofs.ravel().astype(np.int32)).reshape(dofs.shape)
    owned = V.dofmap.index_map.size_local
    x = V.tabulate_dof_coordinates()[:owned, :dim]
    element = basix.ufl.element("Lagrange", mesh.basix_cell(), 2, shape=(dim,))
    return dmesh.create_mesh(mesh.comm, numbers.astype(np.int64), x, element)


def rectangle(low, high, divisions, comm=MPI.COMM_WORLD) -> dmesh.Mesh:
    """A regular mesh of order 2 on a rectangle: ``divisions`` (nx, ny) squares, each cut into two triangles."""
    return order_two(dmesh.create_rectangle(comm, [np.asarray(low, float), np.asarray(high, float)], list(divisions),
                                            dmesh.CellType.triangle))


def box(low, high, divisions, comm=MPI.COMM_WORLD) -> dmesh.Mesh:
    """A regular mesh of order 2 on a box: ``divisions`` (nx, ny, nz) cubes, each cut into six tetrahedra."""
    return order_two(dmesh.create_box(comm, [np.asarray(low, float), np.asarray(high, float)], list(divisions),
                                      dmesh.CellType.tetrahedron))


@contextmanager
def gmsh_model():
    """A fresh, silent gmsh model (rank 0 only)."""
    import gmsh

    fresh = not gmsh.isInitialized()
    if fresh:
        gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("fenics_forming")
    try:
        yield gmsh
    finally:
        gmsh.model.remove()
        if fresh:
            gmsh.finalize()


def polygon(points, size: float, *, corners=(), corner_size: float | None = None, growth: float = 0.2,
            comm=MPI.COMM_WORLD) -> dmesh.Mesh:
    """A mesh of order 2 on a polygon.

    Parameters
    ----------
    points : (n, 2) corners in order, mm
    size : element size, mm
    corners : (k, 2) points where the flow is singular (tool corners); there the elements have ``corner_size`` and
        grow by ``growth`` per unit of distance up to ``size``

    Raises
    ------
    MeshError
        if gmsh cannot mesh it.
    """
    def build(gmsh):
        geo = gmsh.model.geo
        tags = [geo.addPoint(x, y, 0.0, size) for x, y in points]
        lines = [geo.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1], strict=True)]
        geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()

    return generate(build, 2, size, corners=corners, corner_size=corner_size, growth=growth, comm=comm)


def generate(build, dim: int, size: float | None, *, corners=(), corner_size: float | None = None,
             growth: float | np.ndarray = 0.2, from_boundary: bool = True, wanted=None, enduring: bool = False,
             comm=MPI.COMM_WORLD) -> dmesh.Mesh:
    """Mesh what ``build(gmsh)`` puts into the model, on rank 0, and distribute it.

    Parameters
    ----------
    growth : of the size per unit of distance from each corner, one for all or (k,)
    from_boundary : sizes inside follow the sides on the boundary, of which a whole number has to fit; else ``size``
    wanted : finer parts, see `refining.refine`
    enduring : solids get better cells at corners, at some expense, so that a remeshing is due later
    """
    def make():
        with gmsh_model() as gmsh:
            build(gmsh)
            _sizes(gmsh, size, np.asarray(corners, float).reshape(-1, dim), corner_size, growth)
            if not from_boundary:
                gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
            gmsh.model.mesh.generate(dim)
            if wanted is not None:
                from .refining import refine
                refine(gmsh, dim, wanted)
            return sound_arrays(gmsh, dim, _improved if enduring and dim == 3 else split_corner_cells)

    return distributed(make, dim, comm)


def distributed(make, dim: int, comm) -> dmesh.Mesh:
    """The mesh of the arrays (positions, cells in basix order) that ``make()`` returns on rank 0."""
    problem, x, cells = None, np.empty((0, dim)), np.empty((0, _NODES[dim]), np.int64)
    if comm.rank == 0:
        try:
            x, cells = make()
        except Exception as error:  # gmsh raises bare Exceptions
            problem = f"gmsh could not mesh the body: {error}"
    problem = comm.bcast(problem, 0)
    if problem is not None:
        raise MeshError(problem)
    return from_arrays(x, cells, comm)


def from_arrays(x: np.ndarray, cells: np.ndarray, comm=MPI.COMM_WORLD) -> dmesh.Mesh:
    """A mesh of order 2 of the positions (n, dim) and cells (m, 6 or 10), in basix order, that rank 0 gives. Collective."""
    dim = x.shape[1]
    element = basix.ufl.element("Lagrange", {2: "triangle", 3: "tetrahedron"}[dim], 2, shape=(dim,))
    return dmesh.create_mesh(comm, cells.astype(np.int64), x, element)


_NODES = {2: 6, 3: 10}
_GMSH_TYPE = {2: 9, 3: 11}


def arrays(gmsh, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, dim) and quadratic cells (m, 6 or 10), in basix order, of the model."""
    tags, x, _ = gmsh.model.mesh.getNodes()
    _, rows = gmsh.model.mesh.getElementsByType(_GMSH_TYPE[dim])
    if len(rows) == 0:
        raise MeshError(f"it has no {'triangles' if dim == 2 else 'tetrahedra'}")
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    cells = number[rows.astype(np.int64)].reshape(-1, _NODES[dim])
    kind = dmesh.CellType.triangle if dim == 2 else dmesh.CellType.tetrahedron
    cells = cells[:, cell_perm_array(kind, _NODES[dim])]
    used, cells = np.unique(cells, return_inverse=True)
    return x.reshape(-1, 3)[used, :dim], cells.reshape(-1, _NODES[dim])


def sound_arrays(gmsh, dim: int, split) -> tuple[np.ndarray, np.ndarray]:
    """The mesh of the model raised to order 2, cells with several sides on the boundary split (see `split_corner_cells`).

    A cell with a side on a surface that is curved more than the cell is large may be turned inside out by it. Then gmsh is
    asked to move the nodes inside.

    Raises
    ------
    MeshError
        if that does not help.
    """
    gmsh.model.mesh.setOrder(2)
    x, cells = split(*arrays(gmsh, dim), dim)
    if inverted_cells(x, cells).any():
        gmsh.model.mesh.optimize("HighOrder")
        x, cells = split(*arrays(gmsh, dim), dim)
        inverted = int(inverted_cells(x, cells).sum())
        if inverted:
            raise MeshError(f"{inverted} of {len(cells)} cells are turned inside out by the curved surface beside them; a "
                            "smaller mesh_size follows it")
    return x, cells


def inverted_cells(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Whether the map of each cell of order 2 loses its orientation at an integration point of the flow, (cells,).

    At a vertex it may be singular: two sides of a cell on one smooth curve meet there at 180 degrees.
    """
    dim = x.shape[1]
    kind = basix.CellType.triangle if dim == 2 else basix.CellType.tetrahedron
    points, _ = basix.make_quadrature(kind, QUADRATURE_DEGREE[dim])
    element = basix.create_element(basix.ElementFamily.P, kind, 2, basix.LagrangeVariant.gll_warped)
    gradients = element.tabulate(1, points)[1:, :, :, 0]
    det = np.linalg.det(np.einsum("kpa,cad->cpkd", gradients, x[cells]))
    corners = x[cells[:, : dim + 1]]
    return (det * np.linalg.det(corners[:, 1:] - corners[:, :1])[:, None] <= 0).any(axis=1)


def split_corner_cells(x: np.ndarray, cells: np.ndarray, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Cut every cell that has more than one side on the boundary into one cell per side, at its centre.

    Where a side of the body folds down onto a tool, such a cell would be pressed flat.
    """
    corners = cells[:, : dim + 1]
    sides = np.sort(np.stack([np.delete(corners, i, axis=1) for i in range(dim + 1)], axis=1), axis=2)
    _, inverse, counts = np.unique(sides.reshape(-1, dim), axis=0, return_inverse=True, return_counts=True)
    exterior = (counts[inverse.ravel()] == 1).reshape(-1, dim + 1)
    cut = exterior.sum(axis=1) > 1
    if not cut.any():
        return x, cells
    old = cells[cut]
    # the new nodes lie where the quadratic map of the old cell takes them, so that its Jacobian is theirs:
    # straight spokes would invert the cells behind a curved side
    middle_of = np.full((1, dim + 1), 1 / (dim + 1))
    placed = np.einsum("pa,kad->kpd", quadratic_shapes(np.concatenate(
        [middle_of, 0.5 * (np.eye(dim + 1) + middle_of)]), dim), x[old])
    centre, spokes = placed[:, 0], placed[:, 1:]
    first = len(x)
    k = len(old)
    centre_number = first + np.arange(k)
    spoke_number = first + k + np.arange(k * (dim + 1)).reshape(k, dim + 1)
    x = np.concatenate([x, centre, spokes.reshape(-1, dim)])
    edges = EDGES[dim]
    middle = {frozenset(e): old[:, dim + 1 + i] for i, e in enumerate(edges)}
    new = []
    for side in range(dim + 1):      # the vertex opposite to the side is replaced by the centre
        def number(edge, side=side):
            if side in edge:
                other = edge[0] if edge[1] == side else edge[1]
                return spoke_number[:, other]
            return middle[frozenset(edge)]
        columns = [centre_number if v == side else old[:, v] for v in range(dim + 1)] + [number(e) for e in edges]
        new.append(np.stack(columns, axis=1))
    return x, np.concatenate([cells[~cut], *new])


def _improved(x: np.ndarray, cells: np.ndarray, dim: int) -> tuple[np.ndarray, np.ndarray]:
    from .remeshing.solid import BodyArrays, improved

    better = improved(BodyArrays(x, cells))
    return better.x, better.cells


def _sizes(gmsh, size, corners, corner_size, growth):
    if size is not None:
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.setSize(gmsh.model.getEntities(0), size)   # CAD points have none: a tenth of the body otherwise
    gmsh.option.setNumber("Mesh.Algorithm", 6)
    gmsh.option.setNumber("Mesh.HighOrderOptimize", 0)
    if corner_size is None or len(corners) == 0:
        return
    pad = np.zeros((len(corners), 3))
    pad[:, : corners.shape[1]] = corners

    def callback(dim, tag, x, y, z, lc):
        distance = np.sqrt(((pad - (x, y, z)) ** 2).sum(axis=1))
        return min(size, corner_size + (growth * distance).min())

    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.model.mesh.setSizeCallback(callback)


def boundary_facets(mesh: dmesh.Mesh, where) -> np.ndarray:
    """Owned exterior facets of which every vertex satisfies ``where(x)`` (x is (3, n), as in dolfinx)."""
    dim = mesh.topology.dim
    facets = dmesh.locate_entities_boundary(mesh, dim - 1, where)
    return facets[facets < mesh.topology.index_map(dim - 1).size_local]


def exterior_facets(mesh: dmesh.Mesh) -> np.ndarray:
    """All owned exterior facets."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    return dmesh.exterior_facet_indices(mesh.topology)
