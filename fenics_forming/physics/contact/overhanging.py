r"""Nodes at the ends of a surface that have come over the rim of the other one.

Where two bodies end at the same place, as stacked blocks do, the last node of the one is by chance over the other or a
little beside it.  In the classical node-to-facet element it carries half a side, or nothing: then the corners of both
bodies slide through one another.  So such a node keeps to the tangent of the side that it comes from, and of the surface
that it presses there is left :math:`(1-s/s_e)^2` at a way s over the rim, :math:`s_e` so chosen that at first it loses
what hangs over.  Nodes between the ends, those of a wide body under a narrow one, are over it or not.
"""

from __future__ import annotations

import numpy as np

from .capture import Captured, CapturingSurface

END = 1 / 3         # of a side, s_e: Simpson's rule gives a sixth of it to its end, and the slope of the square is two
FARTHEST = 0.25     # of a side of the other body: so far the tangent speaks for it
OPPOSED = -0.7      # cosine between the normals of surfaces that end beside one another


def reaching_over(surface: CapturingSurface, found: Captured, points: np.ndarray, outward: np.ndarray,
                  reach: np.ndarray) -> tuple[Captured, np.ndarray]:
    """What nodes that reach over the rim of a surface are over, and the share of their surface that is left, (points,).

    Parameters
    ----------
    found : where the points (points, dim) are nearest · outward : (points, dim) unit normals of their surface
    reach : (points,) mm, by which each may reach over the rim; 0: not at all
    """
    left, opposed = np.ones(len(points)), np.einsum("pi,pi->p", outward, found.normal) < OPPOSED
    ends = np.flatnonzero((reach > 0) & np.isfinite(found.gap) & ~(opposed & (found.beyond == 0)))
    if len(ends) == 0:
        return found, left
    at, least = points[ends], np.full(len(ends), np.inf)
    best = Captured(*(values[ends].copy() for values in vars(found).values()))
    for facet in _around(surface, found.facet[ends]):
        within = np.where(facet >= 0, np.minimum(reach[ends], FARTHEST * surface.size[facet]), -1.0)
        tried = surface.feet(at, np.maximum(facet, 0), within)
        better = tried.over & (np.einsum("pi,pi->p", outward[ends], tried.normal) < OPPOSED) & \
            (tried.beyond < least) & surface.has_below(at, tried)
        for kept, new in zip(vars(best).values(), vars(tried).values(), strict=True):
            kept[better] = new[better]
        least[better] = tried.beyond[better]
        left[ends[better]] = (1.0 - tried.beyond[better] / within[better]) ** 2
    out = Captured(*(values.copy() for values in vars(found).values()))
    for values, new in zip(vars(out).values(), vars(best).values(), strict=True):
        values[ends] = new
    return out, left


def shortest_edges(vertices: np.ndarray) -> np.ndarray:
    """Of sides with vertices (f, dim, dim) the length of the shortest edge, (f,)."""
    return np.linalg.norm(vertices - np.roll(vertices, 1, axis=1), axis=2).min(axis=1)


def _around(surface: CapturingSurface, facet: np.ndarray) -> list[np.ndarray]:
    """The facets (k,) themselves, then what is beyond their sharp edges, in space also beyond those of these, (k,) each,
    less than 0 where nothing is: the sides around a corner are equally near to what is beyond it."""
    rounds = [[facet]]
    for _ in range(surface.dim - 1):
        rounds.append([np.where((f >= 0) & surface.rim[f, k], surface.neighbours[f, k], -1)
                       for f in rounds[-1] for k in range(surface.dim)])
    return [facets for of_round in rounds for facets in of_round]
