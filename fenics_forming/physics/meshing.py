"""Meshes of order 2: from gmsh for the shapes of a scene, or raised from any dolfinx mesh."""

from __future__ import annotations

from contextlib import contextmanager

import basix.ufl
import numpy as np
from dolfinx import fem, mesh as dmesh
from dolfinx.io import gmshio
from mpi4py import MPI

from ..errors import MeshError


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


def polygon(points, size: float, *, corners=(), corner_size: float | None = None, growth: float = 0.25,
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
        lines = [geo.addLine(a, b) for a, b in zip(tags, tags[1:] + tags[:1])]
        geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()

    return generate(build, 2, size, corners=corners, corner_size=corner_size, growth=growth, comm=comm)


def generate(build, dim: int, size: float | None, *, corners=(), corner_size: float | None = None, growth: float = 0.25,
             comm=MPI.COMM_WORLD) -> dmesh.Mesh:
    """Mesh what ``build(gmsh)`` puts into the model, on rank 0, and distribute it."""
    problem = mesh = None
    if comm.rank == 0:
        with gmsh_model() as gmsh:
            try:
                build(gmsh)
                _sizes(gmsh, size, np.asarray(corners, float).reshape(-1, dim), corner_size, growth)
                gmsh.model.addPhysicalGroup(dim, [tag for _, tag in gmsh.model.getEntities(dim)], 1)
                gmsh.model.mesh.generate(dim)
                gmsh.model.mesh.setOrder(2)
            except Exception as error:  # gmsh raises bare Exceptions
                problem = f"gmsh could not mesh the body: {error}"
            problem = comm.bcast(problem, 0)
            if problem is None:
                mesh = gmshio.model_to_mesh(gmsh.model, comm, 0, gdim=dim)[0]
    else:
        problem = comm.bcast(None, 0)
        if problem is None:
            mesh = gmshio.model_to_mesh(None, comm, 0, gdim=dim)[0]
    if problem is not None:
        raise MeshError(problem)
    return mesh


def _sizes(gmsh, size, corners, corner_size, growth):
    if size is not None:
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.Algorithm", 6)
    gmsh.option.setNumber("Mesh.HighOrderOptimize", 0)
    if corner_size is None or len(corners) == 0:
        return
    pad = np.zeros((len(corners), 3))
    pad[:, : corners.shape[1]] = corners

    def callback(dim, tag, x, y, z, lc):
        distance = np.sqrt(((pad - (x, y, z)) ** 2).sum(axis=1)).min()
        return min(size, corner_size + growth * distance)

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
