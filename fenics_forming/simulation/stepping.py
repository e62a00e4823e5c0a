"""From one step to the next: how long it is, what is tried, and what is done when it fails."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..errors import ConvergenceError, MeshError
from ..process.approach import free_way
from ..process.body import FlowingBody
from ..process.integration import StepEnd, drifting
from ..process.meshes.at_tools import hold_at_tools
from ..process.meshes.hollow_corners import filled_corners
from ..process.room import demand_room
from ..process.schemes import scheme_of
from ..process.timestep import Limit
from ..scene import Scene
from .cooling import cooled, due, resting
from .state import State
from .stops import Stops

FLIGHT = 20     # steps in one while tools are on their way to a body at rest: it may cool meanwhile


class Stepper:
    """Takes a body through the steps of a scene.

    Parameters
    ----------
    keeper : renews the mesh, or None
    volume_ledger : hears what a remeshing does to the volume
    force : of the tool that counts, at present, N
    on_new_mesh : is called when the body has moved to a new mesh

    Attributes
    ----------
    body : on its present mesh
    scheme, choice : how nodes are moved, how long steps are
    solves : velocity solves so far
    renewed : in a step, the state at its start where the body has moved to a new mesh since; else None
    """

    def __init__(self, scene: Scene, body: FlowingBody, stops: Stops, *, keeper, volume_ledger, force: Callable[[], float],
                 on_new_mesh: Callable[[], None]):
        self.scene, self.body, self.stops, self.keeper = scene, body, stops, keeper
        self._volume_ledger, self._force, self._on_new_mesh = volume_ledger, force, on_new_mesh
        self.scheme, self.choice, self.solves = scheme_of(scene.shifting), stops.step_choice(), 1
        self.renewed: State | None = None

    def first(self, observer) -> State:
        """The state at the start, with the flow there; contact looks less far ahead where that is not found."""
        history = self.body.new_history()
        self.body.place(0.0)
        heat = None if self.body.heat is None else self.body.heat.first()
        for last in (False, False, True):
            dt, before = self.choice.next(0.0).dt, self.body.snapshot()
            try:
                flow = self.body.solve(0.0, history, dt, ahead=self.scheme.look_ahead)
                demand_room(self.body)
                return State(0, 0.0, history, flow, dt, heat=heat)
            except ConvergenceError as failure:
                if last or not np.isfinite(dt):
                    raise
                self._go_back(before, self.scheme, 0.0)
                for _ in range(3):
                    self.choice.failed(0.0, self.choice.next(0.0).dt)
                observer.note(f"step 1 cut: {failure.sentence}")

    def advance(self, state: State, observer) -> tuple[State, str]:
        """One step; cut and tried again until it converges or becomes too short."""
        if (operation := due(self.scene, state)) is not None:
            self.renewed, self.solves = None, self.solves + 1
            return cooled(self.body, state, operation, self.scheme.look_ahead), "cooling"
        if state.time in self.stops.turns:
            state = self._turned(state)
        shortened, tries = None, 0                  # a height or force to stop at is hit by secants
        fresh = self.keeper is None                 # whether a new mesh would be no cure any more
        while True:
            limit, dt, reason = self._length(state, shortened)
            body = self.body
            watched, before, scheme = self._watched(), body.snapshot(), copy.copy(self.scheme)
            try:
                reached, solves, error = self._attempt(state, dt)
            except ConvergenceError as failure:
                self._go_back(before, scheme, state.time)
                if not fresh:
                    state, fresh = self._remeshed(state, failure.sentence, observer), True
                    if self.body is not body:
                        continue
                if not self.choice.failed(state.time, limit.dt):
                    raise ConvergenceError(f"step {state.step + 1} fails however short it is: {failure.sentence}",
                                           history=failure.history, advice=failure.advice) from failure
                observer.note(f"step {state.step + 1} cut: {failure.sentence}")
                continue
            except KeyboardInterrupt:            # what is written next must belong together
                self._go_back(before, scheme, state.time)
                raise
            hit = min((dt * (wanted - then) / (now - then) for (then, wanted, near), (now, *_) in
                       zip(watched, self._watched(), strict=False) if then < wanted < now - near), default=None)
            hit = min((time for time in (hit, body.rams.time_left) if time is not None and time < np.inf), default=None)
            if hit is not None and tries < 8 and dt > 1e-3 * limit.dt:      # a force may jump: then no step hits it
                tries, shortened = tries + 1, hit
                self._go_back(before, scheme, state.time)
                continue
            self.choice.succeeded(error, body.size, body.landing_share() if self.choice.is_adaptive else 0.0)
            self.solves += solves
            self.renewed = None
            return reached, reason

    def on_a_fit_mesh(self, state: State, observer) -> State:
        """The state on a new mesh where the present one would not do for the next step."""
        dt = self.choice.next(state.time, state.flow.rate).dt
        reason = self.keeper.reason(self.body, state.flow, dt if dt < np.inf else state.dt, state.step)
        return state if reason is None else self._remeshed(state, reason, observer)

    def _remeshed(self, state: State, reason: str, observer) -> State:
        """The state on a new mesh, and the flow there; the old ones, and a note, where that fails."""
        old = self.body
        try:
            carried = state.history if old.heat is None else state.history | old.heat.packed(state.heat)
            self.body, history, flow = self.keeper.renew(
                old, self.scheme, carried, state.flow, reason=reason, step=state.step, time=state.time,
                dt=state.dt)
        except (MeshError, ConvergenceError) as failure:
            observer.note(f"step {state.step}: the mesh stays as it is, for a new one failed: {failure}")
            return state
        self.solves += 1
        self._volume_ledger.book(self.keeper.records[-1].volume)
        self._on_new_mesh()
        observer.note(f"step {state.step}: new mesh, {self.keeper.records[-1]}")
        heat = None
        if self.body.heat is not None:
            history, heat = self.body.heat.unpacked(history, state.heat)
            flow = drifting(flow, heat)
        self.renewed = replace(state, history=history, flow=flow, heat=heat)
        return self.renewed

    def _watched(self) -> list[tuple[float, float, float]]:
        return self.stops.watched(self.body, self._force() if self.scene.stop.force is not None else 0.0)

    def _length(self, state: State, shortened: float | None) -> tuple[Limit, float, str]:
        """What the steps allow, the length of the step, s, and what set it: also first contact and a wanted height."""
        body, limit = self.body, self.choice.next(state.time, state.flow.rate)
        dt = limit.dt
        if body.workpiece.is_cold:               # free travel: stop where the first tool touches
            body.search(dt)
            touch = body.time_to_contact(dt)
            if 1e-9 * dt < touch < dt:
                return limit, touch, "contact"
            if touch >= dt and self.scene.steps.stroke is not None:
                left = self.choice.left(state.time)
                horizon = min(left, FLIGHT * dt)
                way = free_way(body, self.stops.by_name, state.time, horizon)
                way = way if way == left else np.floor(way / dt + 1e-9) * dt     # as many even steps as there are in it
                if way > 1.5 * dt:
                    return limit, way, "target" if way == left else limit.reason
        elif shortened is not None or self.scene.stop.height is not None:
            reached = shortened or body.time_to_height(self.scene.stop.height, state.flow.velocity, dt)
            if reached < dt:
                return limit, max(reached, 1e-6 * dt), "target"
        return limit, dt, limit.reason

    def _attempt(self, state: State, dt: float) -> tuple[State, int, float]:
        """The state after a step of ``dt``, the solves it took, and its error estimate, mm."""
        body, scheme = self.body, self.scheme
        travels = body.workpiece.is_cold
        for deformation in body.deformations:
            deformation.begin(body, dt)
        start = body.rams.begin(state.flow, dt)
        gathering = body.gathering(state.history)
        filled = () if travels or self.keeper is None else filled_corners(body)
        end = self._travel(gathering, state.time + dt) if travels else \
            scheme.advance(body, start, state.time, gathering, dt)
        time = self.choice.end_of(state.time, dt)       # once: as a ram arrives its next turn is known anew, to rounding
        body.settle(time)
        history = end.history if travels or self.keeper is None else hold_at_tools(body, filled, end.history)
        changes = {} if travels else self._account_for_volume()
        turns = time in self.stops.turns
        ahead = dt if turns else self.choice.next(time, state.flow.rate).dt
        ahead = ahead if 0 < ahead < np.inf else dt
        at = self.stops.just_before(time, dt) if turns else time
        body.move_tools(at)
        # contact looks ahead by the way of the tools: theirs to come, or where they come to rest the last one's
        share = body.pace(at, time - turns * dt, dt if turns else ahead).share
        heat = None
        if body.heat is not None:
            history, heat = resting(body, state.history, state.heat, body.tools, dt) if travels else \
                body.heat.advance(state.history, history, state.heat, body.tools, dt)
            if body.deformations:
                from ..process.heat.expansion import expand
                expand(body, heat)
        flow = body.solve(time, history, share * ahead, ahead=self.scheme.look_ahead)
        if self.scene.stop.force is None or self._force() < self.scene.stop.force:
            demand_room(body)
        flow = replace(flow, iterations=flow.iterations + end.iterations)
        if heat is not None:
            flow = drifting(flow, heat)
        if body.deformations:
            changes = self._follow_tools(time, ahead, changes)
        reached = replace(state, step=state.step + 1, time=time, history=history, flow=flow, dt=ahead,
                          volume_changes=changes, heat=heat)
        return reached, 1 + end.solves, end.error

    def _follow_tools(self, time: float, ahead: float, changes: dict) -> dict:
        """Tools that are solved now and then; the changes of volume with that by which they took the surface along."""
        change = self.body.follow_tools(time, self.scheme.look_ahead * ahead)
        return changes | {"tools": change} if change and not self.scene.is_assembled else changes

    def _account_for_volume(self) -> dict[str, float]:
        """Changes of volume, by cause, at the end of a step, where the volume is restored if that is asked for."""
        if self.scene.is_assembled:
            changes = {name: {"corners": change} for name, change in self.body.returned_volumes().items()}
            if self._volume_ledger.restored:
                for name, done in self.body.restore_volumes(self._volume_ledger.start).items():
                    changes[name]["given back"] = done.given_back
            return changes
        changes = {"corners": self.body.returned_volume()}
        if self._volume_ledger.restored:
            changes["given back"] = self.body.restore_volume(self._volume_ledger.start).given_back
        return changes

    def _turned(self, state: State) -> State:
        """The state with the flow after the tools have turned; what follows knows nothing of the one before."""
        before = self.body.snapshot()
        self.body.move_tools(state.time)
        ahead = self.choice.next(state.time, state.flow.rate).dt
        try:
            flow = self.body.solve(state.time, state.history, ahead if ahead < np.inf else state.dt,
                                   ahead=self.scheme.look_ahead)
        except ConvergenceError:
            self._go_back(before, self.scheme, state.time)
            raise
        self.solves += 1
        self.scheme = scheme_of(self.scene.shifting)
        return replace(state, flow=flow)

    def _travel(self, history: dict, time: float):
        """The tools move on to ``time``, the body rests; what follows knows nothing of the flow before."""
        self.scheme = scheme_of(self.scene.shifting)
        self.body.place(time)
        return StepEnd(history, 0, 0, None, 0.0)

    def _go_back(self, before: tuple, scheme, time: float) -> None:
        self.body.restore(before)
        self.scheme = scheme
        self.body.move_tools(time)
