"""What the shape of the tools asks of the elements near them: sharp corners and roundings."""

from __future__ import annotations

import numpy as np

from ..grading import CORNER_REACH, CORNER_SIZE
from .domains import gap_to
from .field import Around, AtPoints

SIDES = 3               # of elements on a rounding, where no chord is given
QUARTER = np.pi / 2     # what a long arc is divided into for that


def corner_source(tools, surface, *, base: float, least: float, growth: float) -> list[AtPoints]:
    """Sharp corners of the tools near the surface of the body."""
    found = [_in_space(tool, tool.surface.corners()) for tool in tools]
    found = [points[surface(points) <= CORNER_REACH * base] for points in found if len(points)]
    points = np.concatenate(found) if found else np.empty((0, 2))
    return [AtPoints(points, max(CORNER_SIZE * base, least), growth, base)] if len(points) else []


def rounding_sources(tools, surface, body: np.ndarray, *, chord, base: float, least: float, growth: float) -> list:
    """Roundings of the tools near the body: an arc of radius R is followed by sides of

        h = sqrt(8 R chord),   or a third of its length (of a quarter of a turn at most) if no chord is given.

    Parameters
    ----------
    surface : callable, points to their distance from the surface of the body
    body : (n, dim) nodes on that surface
    """
    sources = []
    for tool in tools:
        if tool.surface.radius is not None:
            size = max(float(side_on(tool.surface.radius, QUARTER, chord)), least)
            apart = gap_to(tool)
            if size < base and len(body) and np.abs(apart(body)).min() <= CORNER_REACH * base:
                sources.append(Around(apart, 0.0, size, growth))
            continue
        points, radii, angles = tool.surface.roundings(least)
        size = np.maximum(side_on(radii, angles, chord), least)
        fine = size < base
        points, size = _in_space(tool, points[fine]), size[fine]
        near = surface(points) <= CORNER_REACH * base if len(points) else np.empty(0, bool)
        if near.any():
            sources.append(AtPoints(points[near], size[near], growth, base))
    return sources


def side_on(radius, angle, chord):
    """Length of the sides that follow arcs of a radius (mm) and an angle (rad); see `rounding_sources`."""
    if chord is not None:
        return np.sqrt(8 * np.asarray(radius) * chord)
    return np.asarray(radius) * np.minimum(np.abs(angle), QUARTER) / SIDES


def _in_space(tool, points):
    return points if tool.motion is None else tool.motion.to_space(points)
