"""Mass and initial velocity of the workpieces of a scene."""

from __future__ import annotations

import numpy as np

from ..errors import ConvergenceError
from ..physics.nodes import Nodes
from ..physics.parallel import lowest
from ..scene import Scene
from .approach import NEAR


def mass_of(scene: Scene, parts=None):
    """What of the mass acts (``physics.mass.MassProperties``); None where the scene asks for neither inertia nor weight.

    parts : which cells belong to which of several bodies
    """
    process = scene.process
    if not (process.inertia or process.weight):
        return None
    from ..physics.mass import MassProperties

    densities = [scene.materials[body.material].density for body in scene.workpieces.values()]
    density = densities[0] if parts is None else np.array(densities)[parts.of_cell]
    return MassProperties(density, inertia=process.inertia, weight=process.weight)


def velocity_of(scene: Scene, nodes: Nodes, parts=None) -> np.ndarray | None:
    """Velocities of the nodes at the start, (nodes, dim) mm/s; None where inertia does not act."""
    if not scene.process.inertia:
        return None
    velocity = np.zeros_like(nodes.x)
    for number, body in enumerate(scene.workpieces.values()):
        if body.initial_velocity is not None:
            mine = slice(None) if parts is None else parts.of_node == number
            velocity[mine] = body.initial_velocity.at(nodes.x[mine], scene.geometry)
    return velocity


def follow_weight(body) -> None:
    """Make the weight of a `FlowingBody` without inertia ready for a solve.

    Raises
    ------
    ConvergenceError
        if it touches no tool: what falls needs inertia.
    """
    body.workpiece.mass.follow()
    nearest = min((float(tool.state.gap.min(initial=np.inf)) for tool in body.tools), default=np.inf)
    if lowest(body.nodes.comm, nearest) > NEAR * body.size:
        raise ConvergenceError("no tool touches the body, and nothing else holds it against its weight",
                               advice="process.inertia = true lets it fall until it rests on a tool")
