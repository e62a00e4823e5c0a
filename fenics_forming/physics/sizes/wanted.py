"""From a scene and a body between its tools to the sizes that their shapes ask for."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..remeshing.body_arrays import BodyArrays
from .domains import domain_sources
from .field import Sizes, graded
from .thickness import thickness, ways_around
from .tools import corner_source, rounding_sources

GROWTH = 0.2
LEAST = 0.05            # of the mesh size, where the scene gives no min_size
LAYERS = {2: 3.0, 3: 2.0}               # elements across a thin section
AROUND = 3.0            # the way around the end of a thin section is longer than the one across by this factor
RING = {2: [1, 0], 3: [2, 0, 1]}        # the vertex before each of a side
LAYERS_TO_MIRROR = {2: 2.0, 3: 1.5}     # across the half of one that is cut by a mirror plane


def body_sizes(scene, tools, body: BodyArrays, mirrors: dict[int, float], mesh_size: float) -> Sizes:
    """What the domains of the scene and the shape of the tools near the body ask for.

    Parameters
    ----------
    tools : known tools, at their places of now
    mirrors : axis to coordinate of the mirror planes, the axis of rotation included
    mesh_size : mm, the size where nothing asks for less
    """
    remesh = scene.workpiece.remesh
    growth = GROWTH if remesh is None else remesh.growth
    least = LEAST * mesh_size if remesh is None or remesh.min_size is None else remesh.min_size
    free = body.sides[~on_mirror(body, mirrors)]
    surface, nodes = _distance_from(body.x, free)
    near = dict(base=mesh_size, least=least, growth=growth)
    sources = [*domain_sources(scene.workpiece.refine, tools, surface, growth),
               *corner_source(tools, surface, **near)]
    if remesh is not None:      # without, elements at a rounding would soon be somewhere else
        sources += rounding_sources(tools, surface, nodes, chord=remesh.chord, **near)
    return Sizes(mesh_size, least, growth, tuple(sources))


def thickness_sizes(body: BodyArrays, mirrors: dict[int, float], sizes: Sizes) -> np.ndarray:
    """Sizes at the nodes, (n,), that put some elements across thin sections; inf where nothing is asked for.

    A section is thin where the way around its end is more than three times as long as the one across.
    h = t / 3 (t / 2 in space) at both ends of a section of thickness t, t / 2 (t / 1.5) for half of one at a mirror plane.
    """
    vertices = body.sides[:, : body.dim]
    mirror = on_mirror(body, mirrors)
    across, met = thickness(body.x, vertices, LAYERS[body.dim] * sizes.base)
    # the two walls of a lip or of a notch next to each other bound no section
    # the longest of a facet: which of its vertices comes first depends on the number of ranks
    lengths = np.linalg.norm(body.x[vertices] - body.x[vertices[:, RING[body.dim]]], axis=2).max(axis=1)
    if body.dim == 2:
        across[ways_around(vertices, lengths, met) < AROUND * across] = np.inf
    elif (met >= 0).any():
        from .around import is_around_the_end  # compiled where a section is thin

        # a way over vertices is too long, by a side at most where sides are longer than the section is thick
        axes = mirror_axes(body, mirrors)
        across[is_around_the_end(body.x, vertices, axes, np.where(mirror, -1, met), AROUND * across + lengths)] = np.inf
    wanted = np.maximum(across / np.where(mirror[met], LAYERS_TO_MIRROR[body.dim], LAYERS[body.dim]), sizes.least)
    wanted[mirror] = np.inf
    nodal = np.full(len(body.x), np.inf)
    np.minimum.at(nodal, vertices.ravel(), np.repeat(wanted, body.dim))
    found = np.isfinite(wanted)
    np.minimum.at(nodal, vertices[met[found]].ravel(), np.repeat(wanted[found], body.dim))
    return nodal


def nodal_sizes(sizes: Sizes, body: BodyArrays, mirrors: dict[int, float], *, thin: bool, also=()) -> np.ndarray:
    """`Sizes` at the vertices of a body together with what is known only there, graded: (n,) mm, inf at mid-nodes.

    Parameters
    ----------
    thin : whether thin sections get some elements across
    also : arrays (n,) of further sizes
    """
    vertices, size = np.zeros(len(body.x), dtype=bool), np.full(len(body.x), np.inf)
    vertices[body.cells[:, : body.dim + 1]] = True
    size[vertices] = sizes(body.x[vertices])
    for more in (*also, thickness_sizes(body, mirrors, sizes)) if thin else also:
        size[vertices] = np.fmin(size[vertices], more[vertices])      # no number asks for nothing
    return graded(size, body.x, body.cells[:, : body.dim + 1], sizes.growth)


def on_mirror(body: BodyArrays, mirrors: dict[int, float]) -> np.ndarray:
    """Whether boundary sides lie on a mirror plane, (f,)."""
    return mirror_axes(body, mirrors) >= 0


def mirror_axes(body: BodyArrays, mirrors: dict[int, float]) -> np.ndarray:
    """Axis of the mirror plane on which each boundary side lies, -1 for none, (f,)."""
    corners = body.x[body.sides[:, : body.dim]]
    tolerance = 1e-8 * np.ptp(body.x, axis=0).max()
    found = np.full(len(corners), -1)
    for axis, value in mirrors.items():
        found[(np.abs(corners[:, :, axis] - value) < tolerance).all(axis=1)] = axis
    return found


def mirror_planes(scene, low: np.ndarray, high: np.ndarray) -> dict[int, float]:
    """Axis to coordinate of the mirror planes of a body in the box low … high and, in axisymmetry, of the axis."""
    planes = {scene.axes.index(a): float(low[scene.axes.index(a)]) for a in scene.workpiece.symmetry}
    if scene.geometry == "axisymmetric" and low[0] <= 1e-9 * (high - low).max():
        planes[0] = 0.0
    return planes


def _distance_from(x, sides):
    """Distance from boundary sides by their nodes: too large by a quarter of a side at most; and those nodes."""
    nodes = x[np.unique(sides)]

    @cache
    def tree():     # of no use to tools without corners and roundings
        from scipy.spatial import cKDTree
        return cKDTree(nodes)

    return (lambda points: tree().query(points)[0] if len(nodes) else np.full(len(points), np.inf)), nodes
