"""Times in which the body rests and cools: operations in which the process pauses, and ways of tools through the air."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..scene import Scene
from .state import State

PARTS = 10     # of a step in which tools move and the body rests: such a step may be long


def due(scene: Scene, state: State):
    """The operation (``scene.cooling.Cooling``) whose time has come, or None."""
    operations = scene.process.cooling[state.cooled:]
    return operations[0] if operations and state.time >= operations[0].at * (1 - 1e-9) else None


def resting(body, history: dict, heat, tools, time: float, steps: int = PARTS):
    """History and state of the heat after a body has rested on ``tools`` for a time, s; what was lost is that of all
    steps."""
    lost, through, worst, cut = dict.fromkeys(heat.lost, 0.0), dict.fromkeys(heat.through, 0.0), 0.0, 0
    for _ in range(steps):
        history, heat = body.heat.advance(history, history, heat, tools, time / steps)
        lost |= {name: lost[name] + amount for name, amount in heat.lost.items()}
        through |= {name: through[name] + amount for name, amount in heat.through.items()}
        worst, cut = max(worst, abs(heat.imbalance)), max(cut, heat.cut_pairs)
    return history, replace(heat, lost=lost, through=through, imbalance=worst, cut_pairs=cut,
                            drift=np.zeros_like(heat.drift))


def cooled(body, state: State, operation, ahead: float) -> State:
    """The state after an operation, with the flow that goes on from there; the clock of the process stands still.

    ahead : share of a step that contact looks ahead
    """
    tools = [tool for tool in body.tools if tool.name in operation.on]
    history, heat = resting(body, state.history, state.heat, tools, operation.time, operation.steps)
    flow = body.solve(state.time, history, state.dt, ahead=ahead)
    return replace(state, step=state.step + 1, history=history, flow=flow, heat=heat, volume_changes={},
                   paused=state.paused + operation.time, cooled=state.cooled + 1)
