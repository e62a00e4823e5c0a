"""Meshes of order 2: from gmsh for the shapes of a scene, or raised from any dolfinx mesh."""

from __future__ import annotations

from functools import cache

import basix.ufl
import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from ..errors import MeshError
from .facets import boundary_facets, exterior_facets
from .gmsh_arrays import NODES, gmsh_model, sound_arrays, split_corner_cells

__all__ = ["boundary_facets", "box", "distributed", "exterior_facets", "from_arrays", "generate", "order_two", "polygon",
           "rectangle"]


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
    problem, x, cells = None, np.empty((0, dim)), np.empty((0, NODES[dim]), np.int64)
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
    return dmesh.create_mesh(comm, cells.astype(np.int64), x, _isoparametric(dim))


@cache
def _isoparametric(dim: int):
    return basix.ufl.element("Lagrange", {2: "triangle", 3: "tetrahedron"}[dim], 2, shape=(dim,))


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
