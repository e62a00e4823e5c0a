"""gmsh: straight tetrahedral meshes of a labelled surface, meshed anew patch by patch or filled as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..gmsh_arrays import gmsh_model
from .body_arrays import keys
from .rounding import on_a_grid, to_seven_digits
from .straight import Straight, nearest_nodes, volumes
from .surface import OldSurface

SAME = 1e-6             # of the size of the body: the distance of a node from the corner that it is


def solid(mesh: Straight, size: np.ndarray, surface: OldSurface) -> Straight:
    """New facets on every patch, new segments on every line, new cells.

    Parameters
    ----------
    size : (n,) wanted length of the edges at the nodes, mm

    Raises
    ------
    RuntimeError
        when gmsh fails or loses a line or a corner.
    """
    with gmsh_model() as gmsh:
        view = None
        try:
            _discrete(gmsh, on_a_grid(mesh.x), mesh.facets, mesh.patch, mesh.lines, mesh.line)
            gmsh.model.mesh.createGeometry()
            _volume_within(gmsh)
            view = _wanted_sizes(gmsh, mesh, to_seven_digits(size))
            gmsh.model.mesh.generate(3)
            return _read(gmsh, surface)
        except RuntimeError:
            raise
        except Exception as error:  # gmsh raises bare Exceptions
            raise RuntimeError(str(error)) from error
        finally:
            if view is not None:
                gmsh.view.remove(view)


def refill(mesh: Straight) -> Straight:
    """The same surface, facet by facet, with new cells inside whose size follows the facets.

    Raises
    ------
    RuntimeError
        when gmsh cannot fill it, because the surface cuts itself.
    """
    used, facets = np.unique(mesh.facets, return_inverse=True)
    facets = facets.reshape(-1, 3)
    with gmsh_model() as gmsh:
        try:
            _discrete(gmsh, on_a_grid(mesh.x[used]), facets, mesh.patch)
            _volume_within(gmsh)
            gmsh.option.setNumber("Mesh.Renumber", 0)       # the nodes of the surface are known by their numbers
            gmsh.model.mesh.generate(3)
        except Exception as error:  # gmsh raises bare Exceptions
            raise RuntimeError(str(error)) from error
        x, _, cells = _cells(gmsh)
    number = np.full(len(mesh.x), -1)
    number[used] = np.arange(len(used))
    return replace(mesh, x=x, cells=cells, facets=facets, lines=number[mesh.lines], corners=number[mesh.corners])


def _discrete(gmsh, x, facets, patch, lines=(), line=()):
    """A discrete surface for each patch, a curve for each line, points at their ends: numbers + 1.

    gmsh could find curves and points by itself (createTopology), but in an order that changes from run to run.
    """
    if len(lines):
        _discrete_curves(gmsh, lines, line)
    bounds = _bounds(facets, patch, lines, line)
    patches = [int(k) + 1 for k in np.unique(patch)]
    for k in patches:
        gmsh.model.addDiscreteEntity(2, k, bounds.get(k - 1, []))
    used = np.unique(facets)
    gmsh.model.mesh.addNodes(2, patches[0], used + 1, x[used].ravel())
    start = len(x) + len(lines) + 1       # elements: a number for every node, every segment, every facet
    for k in patches:
        rows = np.flatnonzero(patch + 1 == k)
        gmsh.model.mesh.addElementsByType(k, 2, rows + start, (facets[rows] + 1).ravel())
    for _, node in gmsh.model.getEntities(0):
        gmsh.model.mesh.addElementsByType(node, 15, [node], [node])
    for _, k in gmsh.model.getEntities(1):
        rows = np.flatnonzero(line + 1 == k)
        gmsh.model.mesh.addElementsByType(k, 1, rows + len(x) + 1, (lines[rows] + 1).ravel())
    gmsh.model.mesh.reclassifyNodes()


def _discrete_curves(gmsh, lines, line):
    """Curves and their ends; a closed one begins at its first node. Points have the numbers of their nodes + 1."""
    for k in np.unique(line):
        nodes, count = np.unique(lines[line == k], return_counts=True)
        ends = nodes[count == 1] if (count == 1).any() else nodes[:1].repeat(2)
        for node in np.unique(ends):
            if (0, int(node) + 1) not in gmsh.model.getEntities(0):
                gmsh.model.addDiscreteEntity(0, int(node) + 1)
        gmsh.model.addDiscreteEntity(1, int(k) + 1, [int(node) + 1 for node in ends])


def _bounds(facets, patch, lines, line):
    """Curves (numbers + 1) around each patch."""
    if not len(lines):
        return {}
    count = int(facets.max()) + 1
    edges = keys(np.concatenate([facets[:, [1, 2]], facets[:, [2, 0]], facets[:, [0, 1]]]), count)
    key, order = np.sort(keys(lines, count)), np.argsort(keys(lines, count))
    at = np.minimum(np.searchsorted(key, edges), len(key) - 1)
    on = key[at] == edges
    pairs, sides = np.unique(np.stack([np.tile(patch, 3)[on], line[order[at[on]]]], axis=1), axis=0, return_counts=True)
    if (sides > np.bincount(line)[pairs[:, 1]]).any():
        raise RuntimeError("an edge ends inside a face")
    return {int(k): [int(c) + 1 for c in pairs[pairs[:, 0] == k, 1]] for k in np.unique(pairs[:, 0])}


def _volume_within(gmsh):
    surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
    gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(surfaces)])
    gmsh.model.geo.synchronize()


def _wanted_sizes(gmsh, mesh, size):
    """The sizes at the nodes of the old cells as a field; the number of its view."""
    for name in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)
    p = on_a_grid(mesh.x)[mesh.cells]
    view = gmsh.view.add("size")
    gmsh.view.addListData(view, "SS", len(p), np.concatenate([*np.moveaxis(p, 2, 0), size[mesh.cells]], axis=1).ravel())
    field = gmsh.model.mesh.field.add("PostView")
    gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    return view


def _cells(gmsh):
    """Nodes (n, 3) in the order of their tags, the tags, and the cells (m, 4) of positive volume."""
    tags, x, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    tags, x = tags[order], x.reshape(-1, 3)[order]
    _, cells = gmsh.model.mesh.getElementsByType(4)
    cells = np.searchsorted(tags, cells).reshape(-1, 4)
    turned = volumes(x, cells) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    if len(cells) == 0 or volumes(x, cells).min() <= 0:
        raise RuntimeError("gmsh left no cells, or cells without volume")
    return x, tags, cells


def _read(gmsh, surface):
    """The mesh with the old patches, lines and corners, where all of them are there again."""
    x, tags, cells = _cells(gmsh)
    facets = [np.searchsorted(tags, gmsh.model.mesh.getElementsByType(2, tag)[1]).reshape(-1, 3)
              for _, tag in gmsh.model.getEntities(2)]
    patch = np.repeat([tag - 1 for _, tag in gmsh.model.getEntities(2)], [len(f) for f in facets])
    lines = [np.searchsorted(tags, gmsh.model.mesh.getElementsByType(1, tag)[1]).reshape(-1, 2)
             for _, tag in gmsh.model.getEntities(1)]
    old = np.unique(surface.features.line)
    line = [old[np.argmin([np.abs(surface.on_line(int(k), x[nodes]) - x[nodes]).max() for k in old])]
            for nodes in (np.unique(segments) for segments in lines)]
    on_lines = np.unique(np.concatenate(lines)) if lines else np.empty(0, np.int64)
    corners = nearest_nodes(x, on_lines, surface.corners)
    near = SAME * np.ptp(x, axis=0).max()
    if len(set(line)) < len(old) or (np.abs(x[corners] - surface.corners) > near).any():
        raise RuntimeError("gmsh lost an edge or a corner of the body")
    return Straight(x, cells, np.concatenate(facets), patch, np.concatenate(lines) if lines else np.empty((0, 2), np.int64),
                    np.repeat(line, [len(c) for c in lines]), corners)
