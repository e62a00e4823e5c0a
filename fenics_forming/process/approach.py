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


def free_way(body, drives: dict, time: float, horizon: float) -> float:
    """Time from ``time`` on in which no tool can reach a `FlowingBody` at rest, s; at most ``horizon``. Collective.

    A tool that goes on evenly is at the body when it has travelled the least distance between the two, or later. 0 where
    a tool turns, yields or changes its speed by then.
    """
    way, points = horizon, body.x[body.boundary]
    for tool in body.tools:
        drive = drives.get(tool.name)
        if drive is None:
            continue
        if tool.motion.angular_velocity != 0 or tool.deformation is not None:
            return 0.0
        speed = float(np.linalg.norm(drive.velocity(time)))
        distance = lowest(body.nodes.comm, float(np.min(tool.gap(points)[0], initial=np.inf)))
        way = min(way, max(distance, 0.0) / speed if speed > 0 else np.inf)
    if not np.isfinite(way):
        return 0.0
    evenly = all(np.allclose(drive.displacement(time + way) - drive.displacement(time), way * drive.velocity(time),
                             rtol=0, atol=NEAR * body.size) for drive in drives.values())
    return way if evenly else 0.0


def _closing_time(body, gap, normal, tool_velocity, horizon: float) -> float:
    closing = np.einsum("pi,pi->p", tool_velocity, normal)
    coming = closing > 1e-9 * body.speed
    if (coming & (gap <= NEAR * body.size)).any():
        return 0.0
    return min(horizon, float((gap[coming] / closing[coming]).min(initial=np.inf)))
