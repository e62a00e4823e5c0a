"""When tools on their way touch a body at rest."""

from __future__ import annotations

import numpy as np

from ..physics.parallel import lowest

NEAR = 1e-6      # of the size of the body: a gap that counts as closed


def time_to_contact(body, horizon: float) -> float:
    """Time until the first tool of a `FlowingBody` touches it, s; 0 where one touches already. Collective.

    A round tool touches a node between the contact points, and more of them only as it sinks in: of a body that does
    not flow yet the nodes count too, which tools may touch but not enter.
    """
    first = horizon
    for tool in body.tools:
        state = tool.state
        first = min(first, _closing_time(body, state.gap, state.normal, state.tool_velocity, horizon))
        if body.workpiece.is_cold:
            points = body.x[body.boundary]
            first = min(first, _closing_time(body, *tool.gap(points), tool.motion.velocity_at(points), horizon))
    return max(lowest(body.nodes.comm, first), 0.0)


def _closing_time(body, gap, normal, tool_velocity, horizon: float) -> float:
    closing = np.einsum("pi,pi->p", tool_velocity, normal)
    coming = closing > 1e-9 * body.speed
    if (coming & (gap <= NEAR * body.size)).any():
        return 0.0
    return min(horizon, float((gap[coming] / closing[coming]).min(initial=np.inf)))
