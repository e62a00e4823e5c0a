"""Boxes and cylinders with ends as surfaces of triangles: punches and dies in space."""

from __future__ import annotations

import numpy as np

from .triangulated import Triangulated

TURN = 144       # sides of a cylinder: they lie 0.024 % of the radius inside


def box_surface(low, high) -> Triangulated:
    """The surface of a box between two corners, mm."""
    corners = np.array([[(low, high)[(k >> axis) & 1][axis] for axis in range(3)] for k in range(8)], float)
    quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    return Triangulated(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def cylinder_surface(base, axis, radius: float, height: float) -> Triangulated:
    """The surface of a cylinder with flat ends, mm; its mantle is a prism of `TURN` sides."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    angle = np.arange(TURN)[:, None] * (2 * np.pi / TURN)
    ring = np.asarray(base, float) + radius * (np.cos(angle) * first + np.sin(angle) * np.cross(axis, first))
    k = np.arange(TURN)
    after = (k + 1) % TURN
    low, high = np.full(TURN, 2 * TURN), np.full(TURN, 2 * TURN + 1)
    triangles = [(k, after, TURN + after), (k, TURN + after, TURN + k), (low, after, k), (high, TURN + k, TURN + after)]
    vertices = np.concatenate([ring, ring + height * axis, [base], [base + height * axis]])
    return Triangulated(vertices, np.concatenate([np.stack(t, axis=1) for t in triangles]))
