"""What holds a tool: displacements that are given, and springs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..conditions import facet_nodes
from ..nodes import Nodes


@dataclass(frozen=True)
class FixedDisplacement:
    """Displacement component ``component`` on ``facets`` is ``value`` (mm): a number or f(x (n, dim)) → (n,).

    A symmetry plane is its facets with their normal component; so is the axis of an axisymmetric body.
    """

    facets: np.ndarray
    component: int
    value: float | object = 0.0

    def nodes(self, nodes: Nodes) -> np.ndarray:
        """Local nodes that are held."""
        return facet_nodes(nodes, self.facets)


@dataclass(frozen=True)
class FixedPoint:
    """Displacement component ``component`` of the node at ``point`` (mm) is ``value``, mm: keeps a body from drifting."""

    point: tuple[float, ...]
    component: int
    value: float | object = 0.0

    def nodes(self, nodes: Nodes) -> np.ndarray:
        """The node there on the ranks that have it. Collective."""
        return nodes_at(nodes, self.point)


@dataclass(frozen=True)
class Springs:
    """Springs spread over ``facets``, N/mm³ (force per area and displacement), that act along the axis ``component``;
    without it along the normal, as an elastic foundation does."""

    facets: np.ndarray
    stiffness: float
    component: int | None = None


@dataclass(frozen=True)
class PointSprings:
    """One spring, N/mm, along the axis ``component`` at each of the ``points`` (k, dim), where the mesh has nodes.

    In plane strain the stiffness is that per mm of depth, in axisymmetry that of the full ring.
    """

    points: np.ndarray
    stiffness: float
    component: int


def nodes_at(nodes: Nodes, points) -> np.ndarray:
    """Local nodes at points (k, dim) that are nodes of the mesh. Collective.

    Raises
    ------
    ValueError
        if no rank has a node there.
    """
    low, high = nodes.extents()
    reach = 1e-6 * np.linalg.norm(high - low)
    found = []
    for point in np.asarray(points, float).reshape(-1, nodes.dim):
        near = np.flatnonzero(np.linalg.norm(nodes.x - point, axis=1) < reach)
        if not any(nodes.comm.allgather(len(near))):
            raise ValueError(f"the mesh has no node at {point.tolist()} mm")
        found.append(near)
    return np.concatenate(found)
