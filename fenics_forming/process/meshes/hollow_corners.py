"""Hollow corners of tools that a plane body fills: material flows around them, a vertex of the body stays.

Where walls of a die meet in a sharp corner, the flow slows down towards it, and the nodes go past it one after the other.
The side behind the one that has left bridges the corner: the body no longer fills it, and with the size of that gap the
force goes up and down from step to step.
"""

from __future__ import annotations

import numpy as np

from ...physics.parallel import total
from ...physics.remeshing import BodyArrays
from .tool_corners import drawn_back, sharp_corners

AT = 1e-6             # of the size of the body: a vertex so near to a corner is in it
PRESSED = 2           # sides, at least: those on either side of the corner


def in_hollow_corners(body: BodyArrays, tools) -> np.ndarray:
    """Hollow corners of tools, (k, 2) mm, in which a vertex of the boundary of a plane body lies."""
    vertices = body.x[np.unique(body.sides[:, :2])]
    corners = [places[hollow] for places, hollow in map(sharp_corners, tools)]
    corners = np.concatenate([np.empty((0, 2)), *corners])
    away = np.linalg.norm(vertices[:, None] - corners, axis=2).min(axis=0, initial=np.inf)
    return corners[away < AT * np.ptp(vertices, axis=0).max()]


def filled_corners(body) -> list[tuple[object, int]]:
    """The tools and the numbers of their hollow corners that a plane ``FlowingBody`` fills, pressed on both sides.
    Collective."""
    found = []
    for tool in body.tools if body.nodes.dim == 2 else ():
        corners, hollow = sharp_corners(tool)
        ends = body.contact.facets.facet_nodes[:, :2]
        pressed = (tool.state.pressure.reshape(-1, body.contact.facets.points_per_facet) > 0.0).any(axis=1)
        for k in np.flatnonzero(hollow):
            there = (np.linalg.norm(body.x[ends] - corners[k], axis=2) < AT * body.size).any(axis=1)
            if total(body.nodes.comm, int((there & pressed).sum())) >= PRESSED:
                found.append((tool, int(k)))
    return found


def hold_hollow_corners(body, filled, history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Draw the vertex that is nearest to each of the corners that were ``filled`` before the step back to it, in place; the
    history found there. Collective."""
    for tool, k in filled:
        corner = sharp_corners(tool)[0][k]
        for free, _ in body.skins():
            history = drawn_back(body, free, tool, corner, history)
    return history
