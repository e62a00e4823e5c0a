"""From the workpiece of a scene to its mesh of order 2."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..errors import MeshError
from ..scene import Scene
from . import gmsh_arrays, meshing
from .grading import CORNER_REACH, CORNER_SIZE, EDGE_GROWTH, GROWTH
from .parallel import total

AUTOMATIC = {2: 0.044, 3: 0.183}     # mesh size of a square or cube of side 1


def body_mesh(scene: Scene, tools, comm=MPI.COMM_WORLD, *, edge_growth: float = EDGE_GROWTH):
    """Mesh of the workpiece, graded to the sharp corners of the tools near it; the mesh size used, mm.

    Raises
    ------
    MeshError
        if the shape cannot be meshed or the file does not hold a body of the scene's dimension.
    """
    workpiece = scene.workpiece
    shape, dim = workpiece.shape, scene.dimension
    if shape.kind == "file":
        return _from_file(scene, tools, comm)
    size = largest_size(workpiece, shape.volume_or_area(), dim)
    mirrors = _mirrors(scene)
    singular = _corners_near(shape.bounds(), tools, CORNER_REACH * size, dim)
    edges = _corners_on_tools(shape, tools, 1e-6 * size)
    corners = np.concatenate([singular, edges])
    if workpiece.remesh is not None:
        edge_growth = GROWTH        # only measured on a mesh that stays
    growth = np.repeat([GROWTH, edge_growth], [len(singular), len(edges)])
    builder, touching = BUILDERS[shape.kind], corners if dim == 2 else _touching_edges(scene, tools, size)
    mesh = meshing.generate(lambda gmsh: builder(gmsh, shape, size, mirrors, touching), dim, size, corners=corners,
                            corner_size=CORNER_SIZE * size if len(corners) else None, growth=growth,
                            from_boundary=workpiece.mesh_size is not None,
                            wanted=_finer_parts(scene, tools, lambda: size, corners),
                            enduring=workpiece.remesh is not None, comm=comm)
    return mesh, size


def automatic_size(volume: float, dim: int) -> float:
    """Element size that cuts a cube into about 1200 tetrahedra, a square into about 1200 triangles, mm.

    The factors are those of the counts that gmsh makes with it: 1150 to 1300 from 0.1 to 300 mm.
    """
    return AUTOMATIC[dim] * volume ** (1 / dim)


def largest_size(workpiece, volume: float, dim: int) -> float:
    """Element size where nothing asks for less, mm: given by the scene or automatic."""
    size = workpiece.mesh_size or automatic_size(volume, dim)
    remesh = workpiece.remesh
    return size if remesh is None or remesh.max_size is None else min(size, remesh.max_size)


def _finer_parts(scene: Scene, tools, size, corners):
    """What `meshing.generate` takes as ``wanted``; None if the scene asks for nothing of the kind.

    ``size`` is a callable: of a CAD file it is known only when gmsh has read it.
    """
    workpiece = scene.workpiece
    if workpiece.remesh is None and not workpiece.refine:
        return None
    from .sizes import AtPoints, body_sizes, mirror_planes, nodal_sizes

    def wanted(body):
        mirrors = mirror_planes(scene, body.x.min(axis=0), body.x.max(axis=0))
        sizes = body_sizes(scene, tools, body, mirrors, size())
        if len(corners):
            sizes = sizes.and_also(AtPoints(corners, CORNER_SIZE * size(), sizes.growth, size()))
        return nodal_sizes(sizes, body, mirrors, thin=workpiece.remesh is not None)

    return wanted


def _mirrors(scene: Scene) -> tuple[int, ...]:
    """Axes on which a round body is cut in half: symmetry planes and the axis of rotation."""
    axes = [scene.axes.index(a) for a in scene.workpiece.symmetry]
    if scene.geometry == "axisymmetric":
        axes.append(0)
    return tuple(axes)


def _corners_near(bounds, tools, reach, dim):
    low, high = np.asarray(bounds)
    found = [np.asarray(t.surface.corners(), float).reshape(-1, dim) for t in tools]
    corners = np.concatenate(found) if found else np.empty((0, dim))
    return corners[((corners >= low - reach) & (corners <= high + reach)).all(axis=1)]


def _touching_edges(scene: Scene, tools, size: float) -> list:
    """Sharp edges of tools in space that lie on the surface of the body, see `imprint.edges_on`."""
    if all(tool.surface.radius is not None or len(tool.surface.edges()) == 0 for tool in tools):
        return []
    from .imprint import circles_of, edges_on
    circles = {name: circles_of(tool) for name, tool in scene.tools.items()}
    return edges_on(scene.workpiece.shape, tools, {name: found for name, found in circles.items() if found}, size)


def _corners_on_tools(shape, tools, tolerance):
    """Corners of a plane body that touch a tool with friction: the edge of the contact, from where the side folds down."""
    if not hasattr(shape, "corners"):
        return np.empty((0, shape.dimension))
    corners = np.asarray(shape.corners, float)
    touched = np.zeros(len(corners), dtype=bool)
    for tool in tools:
        if tool.has_friction:
            touched |= np.abs(tool.surface.closest(corners)[0]) < tolerance
    return corners[touched]


# ---------------------------------------------------------------------- shapes in gmsh
def _outline(gmsh, shape, size, mirrors, touching=()):
    geo = gmsh.model.geo
    pieces = shape.pieces
    if len(touching):
        from .imprint import split_at
        pieces = split_at(pieces, touching, size)
    ends = [geo.addPoint(*piece.start, 0.0, size) for piece in pieces]
    curves = []
    for k, piece in enumerate(pieces):
        a, b = ends[k], ends[(k + 1) % len(ends)]
        if hasattr(piece, "centre"):
            curves.append(geo.addCircleArc(a, geo.addPoint(*piece.centre, 0.0, size), b))
        else:
            curves.append(geo.addLine(a, b))
    geo.addPlaneSurface([geo.addCurveLoop(curves)])
    geo.synchronize()


def _disk(gmsh, shape, size, mirrors, touching=()):
    occ = gmsh.model.occ
    body = [(2, occ.addDisk(*shape.centre, 0.0, shape.radius, shape.radius))]
    if neck := getattr(shape, "neck", None):
        body, _ = occ.cut(body, [(2, occ.addDisk(*shape.centre, 0.0, neck, neck))])
    through = [a for a in mirrors if shape.centre[a] < shape.radius]
    _keep_high_half(occ, body, np.append(shape.centre, 0.0), shape.radius, through)


def _box(gmsh, shape, size, mirrors, touching=()):
    low, high = np.asarray(shape.bounds())
    gmsh.model.occ.addBox(*low, *(high - low))
    gmsh.model.occ.synchronize()
    _printed(gmsh, touching)


def _cylinder(gmsh, shape, size, mirrors, touching=()):
    occ = gmsh.model.occ
    axis = np.asarray(shape.axis, float)
    axis /= np.linalg.norm(axis)
    body = [(3, occ.addCylinder(*shape.base, *(shape.height * axis), shape.radius))]
    round_axes = [a for a in mirrors if abs(axis[a]) < 1e-12]
    _keep_high_half(occ, body, np.asarray(shape.base, float), 2 * (shape.radius + shape.height), round_axes)
    _printed(gmsh, touching)


def _printed(gmsh, edges):
    if len(edges):
        from .imprint import print_edges
        print_edges(gmsh, edges)


def _keep_high_half(occ, body, centre, reach, axes):
    """Cut away what lies below the centre on the given axes (a mirror plane through a round body)."""
    for axis in axes:
        low = centre - 2 * reach
        extent = np.full(3, 4 * reach)
        low[axis], extent[axis] = centre[axis] - 4 * reach, 4 * reach
        body, _ = occ.cut(body, [(3, occ.addBox(*low, *extent))])
    occ.synchronize()


BUILDERS = {"rectangle": _outline, "polygon": _outline, "circle": _disk, "box": _box, "cylinder": _cylinder}
"""Kind of shape → function (gmsh, shape, size, axes of mirror planes through round bodies, corners or edges of tools that
lie on its surface) that puts it into gmsh."""


# ---------------------------------------------------------------------- files
def _from_file(scene, tools, comm):
    workpiece, dim = scene.workpiece, scene.dimension
    path = str(workpiece.shape.file)
    scale = workpiece.shape.scale
    if path.endswith(".msh"):
        return read_msh(path, scale, dim, comm)
    size = {}

    def build(gmsh):
        size["h"] = largest_size(workpiece, import_cad(gmsh, path, scale, dim), dim)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size["h"])

    mesh = meshing.generate(build, dim, workpiece.mesh_size, wanted=_finer_parts(scene, tools, lambda: size["h"], ()),
                            enduring=workpiece.remesh is not None, comm=comm)
    return mesh, comm.bcast(size.get("h"), 0)


def import_cad(gmsh, path, scale, dim) -> float:
    """Put the body of a CAD file into gmsh; its volume, mm³ (area, mm²).

    Raises
    ------
    MeshError
        if the file holds no body of this dimension.
    """
    entities = gmsh.model.occ.importShapes(path)
    if scale != 1.0:
        gmsh.model.occ.dilate(entities, 0, 0, 0, scale, scale, scale)
    gmsh.model.occ.synchronize()
    if not gmsh.model.getEntities(dim):
        raise MeshError(f"{path} holds no body of dimension {dim}")
    return sum(gmsh.model.occ.getMass(dim, tag) for _, tag in gmsh.model.getEntities(dim))


def read_msh(path, scale, dim, comm):
    """Mesh of order 2 from a file of gmsh, and the mean length of its edges, mm."""
    def make():
        with gmsh_arrays.gmsh_model() as gmsh:
            gmsh.merge(path)
            gmsh.model.mesh.setOrder(2)
            x, cells = gmsh_arrays.split_corner_cells(*gmsh_arrays.arrays(gmsh, dim), dim)
            return scale * x, cells

    mesh = meshing.distributed(make, dim, comm)
    local = mesh.topology.index_map(dim).size_local
    p = mesh.geometry.x[mesh.geometry.dofmap[:local, : dim + 1], :dim]
    lengths = total(comm, np.array([np.linalg.norm(p[:, 1] - p[:, 0], axis=1).sum(), local]))
    return mesh, float(lengths[0] / lengths[1])
