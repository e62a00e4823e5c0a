"""The domains of a scene as sources of a size field."""

from __future__ import annotations

import numpy as np

from .field import Around


def domain_sources(domains, tools, surface, growth: float) -> list[Around]:
    """One source for each domain.

    Parameters
    ----------
    domains : of the scene's ``refine``
    tools : known tools, at their places of now
    surface : callable, points to their distance from the surface of the body
    """
    named = {tool.name: tool for tool in tools}
    sources = []
    for domain in domains:
        match domain.kind:
            case "box":
                apart, distance = box(domain.from_, domain.to), 0.0
            case "sphere":
                apart, distance = sphere(domain.centre, domain.radius), 0.0
            case "cylinder":
                apart, distance = cylinder(domain.base, domain.axis, domain.radius, domain.height), 0.0
            case "near_tool":
                apart, distance = gap_to(named[domain.tool]), domain.distance
            case "near_surface":
                apart, distance = surface, domain.distance
        sources.append(Around(apart, distance, domain.size, growth))
    return sources


def box(low, high):
    """Distance from a box; 0 inside."""
    low, high = np.asarray(low, float), np.asarray(high, float)

    def apart(points):
        return np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)

    return apart


def sphere(centre, radius: float):
    """Distance from a ball; 0 inside."""
    def apart(points):
        return np.maximum(np.linalg.norm(points - np.asarray(centre, float), axis=1) - radius, 0.0)

    return apart


def cylinder(base, axis, radius: float, height: float):
    """Distance from a solid cylinder; 0 inside."""
    base, axis = np.asarray(base, float), np.asarray(axis, float)
    axis = axis / np.linalg.norm(axis)

    def apart(points):
        offset = points - base
        along = offset @ axis
        across = np.linalg.norm(offset - along[:, None] * axis, axis=1)
        return np.hypot(np.maximum(across - radius, 0.0), np.maximum(np.maximum(-along, along - height), 0.0))

    return apart


def gap_to(tool):
    """Distance from the surface of a tool where it is now."""
    motion = tool.motion

    def apart(points):
        return tool.surface.closest(points if motion is None else motion.to_tool(points))[0]

    return apart
