"""How far tools and body reach into one another between the nodes, which alone are kept on the tools.

Sides of elements cut through rounded or sharp edges of a tool, and a sharp edge sinks into a side. Both are measured
against the size of the side, and tell that the mesh is too coarse there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ..physics.parallel import highest
from ..physics.surface import Surface

NEWTON_STEPS = 8


@dataclass(frozen=True)
class Depths:
    """How deep something is, everywhere on this rank and at its worst on all ranks.

    Attributes
    ----------
    depth : (k,) mm, 0 where nothing reaches in
    size : (k,) size of the element side that it concerns, mm
    at : (k, dim) where, mm
    worst : greatest depth relative to the size of its side, of all ranks
    """

    depth: np.ndarray
    size: np.ndarray
    at: np.ndarray
    worst: float


def side_penetration(surface: Surface, x: np.ndarray, tools) -> dict[str, Depths]:
    """Tool name → depth by which each side of the body (f,) sinks into the tool, between its nodes. Collective.

    A quadratic side is looked at at 1/4, 1/2 and 3/4 of its length, a quadratic facet at the same points of its three
    edges and at the centres of the four triangles that the middles of the edges cut it into.

    Parameters
    ----------
    x : (n, dim) positions of the nodes, mm
    tools : ``KnownTool`` at their present places
    """
    points = surface.points_of(x, SAMPLES[surface.dim])
    size = surface.lengths(x)
    found = {}
    for tool in tools:
        gap = tool.gap(points.reshape(-1, surface.dim))[0].reshape(points.shape[:2])
        deepest = np.argmin(gap, axis=1)
        depth = np.maximum(-np.take_along_axis(gap, deepest[:, None], axis=1)[:, 0], 0.0)
        at = np.take_along_axis(points, deepest[:, None, None], axis=1)[:, 0]
        worst = highest(surface.comm, float((depth / size).max(initial=0.0)))
        found[tool.name] = Depths(depth, size, at, worst)
    return found


def corner_undercut(surface: Surface, x: np.ndarray, tools) -> dict[str, Depths]:
    """Tool name → depth by which each of its sharp corners (k,) lies below the surface of the body. Collective.

    Every rank gets all corners. Surfaces of tools in space have no corners; then k is 0.
    """
    found = {}
    size = surface.lengths(x)
    for tool in tools:
        corners = np.asarray(tool.surface.corners(), float).reshape(-1, surface.dim)
        corners = tool.motion.to_space(corners)
        depth, sizes = np.zeros(len(corners)), np.full(len(corners), np.inf)
        if len(corners):
            height, side = _height_above(surface, x, corners)
            depth = np.maximum(-height, 0.0)
            sizes = _of_nearest(surface.comm, np.abs(height), size[side] if len(size) else sizes)
            depth = _of_nearest(surface.comm, np.abs(height), depth)
        found[tool.name] = Depths(depth, sizes, corners, float((depth / sizes).max(initial=0.0)))
    return found


def _samples(dim):
    """Local coordinates of the points at which a side is looked at, (points, dim - 1)."""
    quarters = np.array([0.25, 0.5, 0.75])
    if dim == 2:
        return quarters[:, None]
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    edges = [a + t * (b - a) for a, b in ((corners[i], corners[(i + 1) % 3]) for i in range(3)) for t in quarters]
    return np.array([*edges, *(corners / 2 + 1 / 6), [1 / 3, 1 / 3]])


SAMPLES = {2: _samples(2), 3: _samples(3)}


def _height_above(surface: Surface, x: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance (k,) of points of the plane from this rank's sides, negative below them, and the nearest side (k,)."""
    if len(surface.sides) == 0:
        return np.full(len(points), np.inf), np.zeros(len(points), int)
    a, b, m = np.moveaxis(x[surface.sides], 1, 0)
    # the parabola a + s (b - a) + 4 s (1 - s) w, with w how far the middle lies off the half-way
    along, w = b - a, m - 0.5 * (a + b)
    off = points[:, None] - a
    s = np.clip(np.einsum("kfi,fi->kf", off, along) / (along**2).sum(axis=1), 0.0, 1.0)
    for _ in range(NEWTON_STEPS):
        tangent = along + 4 * (1 - 2 * s)[..., None] * w
        to = s[..., None] * along + 4 * (s * (1 - s))[..., None] * w - off
        slope = (tangent**2).sum(axis=-1)
        curvature = slope - 8 * np.einsum("kfi,fi->kf", to, w)
        curvature = np.where(curvature > 0.1 * slope, curvature, slope)
        s = np.clip(s - np.einsum("kfi,kfi->kf", to, tangent) / curvature, 0.0, 1.0)
    away = off - s[..., None] * along - 4 * (s * (1 - s))[..., None] * w
    distance = np.linalg.norm(away, axis=-1)
    near = distance.min(axis=1)
    tangent = along + 4 * (1 - 2 * s)[..., None] * w
    normal = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    # at a common vertex of two sides the mean of their normals tells in from out
    shared = distance <= near[:, None] * (1 + 1e-9) + 1e-12 * np.ptp(x, axis=0).max()
    outward = np.einsum("kfi,kf->ki", normal, shared.astype(float))
    side = np.argmin(distance, axis=1)
    to_point = away[np.arange(len(points)), side]
    return np.where(np.einsum("ki,ki->k", to_point, outward) < 0, -near, near), side


def _of_nearest(comm: MPI.Comm, distance: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Of the values (k,) of all ranks those of the rank that is nearest, (k,)."""
    if comm.size == 1:
        return values
    distances, all_values = np.array(comm.allgather(distance)), np.array(comm.allgather(values))
    return all_values[np.argmin(distances, axis=0), np.arange(len(values))]
