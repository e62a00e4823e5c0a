"""When a run ends, and the times that its steps must hit."""

from __future__ import annotations

import numpy as np

from ..process.body import FlowingBody
from ..process.timestep import Adaptivity, StepChoice
from ..scene import Scene
from .state import State

NEAR_FORCE = 1e-3  # of a force to stop at: how exactly it is hit

GRADUAL = 1e-2     # of the step in which a crank comes to its dead centre


class Stops:
    """The conditions of a scene on the end of the run and on its steps.

    Attributes
    ----------
    drive : of the tool that counts; None where no tool moves
    drives : of all tools that move · by_name : tool → drive, of those that have one
    """

    def __init__(self, scene: Scene, drives: dict):
        self.scene = scene
        self.drive = drives[scene.counting_tool] if scene.counting_tool is not None else None
        self.drives, self.by_name = [drives[name] for name in scene.driven_tools], drives

    @property
    def turns(self) -> list[float]:
        """Times at which a tool starts, stops or turns back: what is recorded there is the flow before."""
        return [t for drive in self.drives for t in drive.turning_times]

    def just_before(self, time: float, dt: float) -> float:
        """The moment whose flow is recorded at a turn at ``time``, in a step of ``dt``: the last one, but a hundredth of
        the step earlier where a crank comes to rest, since without speed there is no flow."""
        gradual = any(d.dead_centre_time is not None and time in d.turning_times for d in self.drives)
        return time - GRADUAL * dt if gradual else np.nextafter(time, -np.inf)

    def _all_spent(self, time: float) -> bool:
        """Whether the last blow is over and no other tool travels any more. A frame that was stretched in it goes on
        pressing on the body, against which it is in balance."""
        return self.drive is not None and self.drive.spends_energy and self.drive.is_spent and not any(
            np.isfinite(d.time_of_travel(d.travel(time) + 1.0, time)) for d in self.drives)

    def step_choice(self) -> StepChoice:
        """How long steps are: what the scene asks for, and the times that must be hit."""
        scene, drive = self.scene, self.drive
        if scene.steps.time is not None:
            nominal = lambda t: scene.steps.time  # noqa: E731
        else:
            def nominal(t):
                drives = [drive] if drive.velocity(t).any() else self.drives     # one that rests sets no steps
                end = min(d.time_of_travel(d.travel(t) + scene.steps.stroke, t) for d in drives)
                return (end if np.isfinite(end) else max([t, *self._landmarks()])) - t or np.inf
        adaptive = scene.steps.adaptive
        limits = None if adaptive is None else Adaptivity(adaptive.max_strain_increment, adaptive.tolerance)
        return StepChoice(nominal, self._landmarks, limits, adaptive.min_fraction if adaptive else 1e-3)

    def _landmarks(self) -> list[float]:
        """Times that steps must end at, s."""
        drive, stop, strokes = self.drive, self.scene.stop, list(self.scene.output.strokes)
        times = [drive.time_of_travel(s) for s in strokes + ([stop.stroke] if stop.stroke is not None else [])]
        times += [*self.turns, *(operation.at for operation in self.scene.process.cooling)]
        return [t for t in times + ([stop.time] if stop.time is not None else []) if np.isfinite(t)]

    def watched(self, body: FlowingBody, force: float) -> list[tuple[float, float, float]]:
        """Of all that a run stops at and a step may go past: its value, rising, that to stop at, and how near is hit."""
        stop, found = self.scene.stop, []
        if stop.height is not None:
            found.append((-body.height(), -stop.height, 1e-6 * stop.height))
        if stop.force is not None and not body.workpiece.is_cold:      # at first contact it jumps
            found.append((force, stop.force, NEAR_FORCE * stop.force))
        return found

    def reached(self, state: State, body: FlowingBody, force: float) -> str | None:
        """Why the run is over, or None; ``force`` of the tool that counts, N."""
        stop, drive = self.scene.stop, self.drive
        if stop.stroke is not None and drive.travel(state.time) >= stop.stroke * (1 - 1e-9):
            return f"stroke {stop.stroke:g} mm reached"
        if stop.time is not None and state.time >= stop.time * (1 - 1e-9):
            return f"time {stop.time:g} s reached"
        if stop.force is not None and force >= stop.force * (1 - NEAR_FORCE):
            return f"force {stop.force:g} N reached"
        if stop.dead_centre and state.time >= drive.dead_centre_time * (1 - 1e-9):
            return "dead centre reached"
        if stop.energy_spent and drive.is_spent:
            return "energy spent"
        if stop.time is None and drive is not None and drive.stalls:
            return "the force limit of the drive holds the tool back"
        if stop.height is not None and body.height() <= stop.height * (1 + 1e-6):
            return f"height {stop.height:g} mm reached"
        end = stop.time or (np.inf if stop.stroke is None else drive.time_of_travel(stop.stroke, state.time))
        if end == np.inf and state.time >= max(self.turns, default=0.0):
            if self._all_spent(state.time):
                return "energy spent: the stop was not reached"
            body.move_tools(state.time)
            body.search(state.dt)
            if body.time_to_contact(np.inf) == np.inf and not body.is_pushed(state.dt):
                return "no tool comes towards the body any more: the stop was not reached"
        return None
