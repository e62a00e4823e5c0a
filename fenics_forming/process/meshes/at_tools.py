"""Where the surface of a body goes around a sharp corner or edge of a tool: vertices come there and stay there."""

from __future__ import annotations

import numpy as np

from ...physics.remeshing import BodyArrays
from .hollow_corners import hold_hollow_corners, in_hollow_corners
from .tool_corners import drawn_to_corners, hold_corners, with_edges


def drawn_to_tools(body: BodyArrays, sizes, tools, mirrors: dict[int, float]) -> tuple[BodyArrays, np.ndarray]:
    """The body with vertices of its boundary at the corners, in space on the edges, of the tools that it slides over; and
    places (k, dim) at which the boundary, in space an edge of the body has a corner for that, whatever its shape."""
    if with_edges(tools):
        from .drawn_edges import drawn_to_edges
        return drawn_to_edges(body, tools, mirrors)
    drawn = drawn_to_corners(body, sizes, tools, mirrors)
    return drawn, in_hollow_corners(drawn, tools) if body.dim == 2 else np.empty((0, body.dim))


def hold_at_tools(body, filled, history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Draw vertices that have just left a corner or an edge back to it, in place; the history found there. Collective.

    filled : hollow corners that were filled before the step, see `filled_corners`
    """
    if with_edges(body.tools):
        from .held_edges import hold_edges
        return hold_edges(body, history)
    return hold_hollow_corners(body, filled, hold_corners(body, history))
