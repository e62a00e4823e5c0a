"""Time schemes: how one step takes the body from one time to the next.

Each scheme gets the flow at the start of the step already solved and leaves positions and history at its end: what has
gathered in the material points, by name and node, "effective_strain" always.
``solve(time, history, dt)`` places the tools, puts sunken nodes back, and solves the flow on the present geometry;
dt is the step to which the solve belongs, of which contact looks ahead the share ``ahead``, with the ``gaps`` of an earlier
solve where they are given.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from . import shifting

GRADUAL = 0.01  # of a step: how long before its end tools that come to rest there still make the body flow


@dataclass(frozen=True)
class Flow:
    """The flow at one instant, by nodes: velocity (n, d) mm/s, rates of the history (n,) 1/s, iterations spent.

    share : of the flow that was solved for, where tools change their speed in a step · pace : their mean speed in it,
    mm/s; else 1
    """

    velocity: np.ndarray
    rates: dict[str, np.ndarray]
    iterations: int
    share: float = 1.0
    pace: float = 1.0

    @property
    def rate(self) -> np.ndarray:
        """Effective strain rate (n,), 1/s."""
        return self.rates["effective_strain"]


@dataclass(frozen=True)
class StepEnd:
    """What a scheme leaves: history, the iterations and solves it spent, the flow at the end where it has one,
    and an estimate of the position error of the step, mm."""

    history: dict[str, np.ndarray]
    iterations: int
    solves: int
    flow: Flow | None
    error: float


class Body(Protocol):
    """What a scheme may do with the body."""

    x: np.ndarray

    def solve(self, time: float, history: dict[str, np.ndarray], dt: float, *, ahead: float = 1.0,
              gaps: dict[str, np.ndarray] | None = None) -> Flow: ...

    def gaps(self) -> dict[str, np.ndarray]: ...

    def place(self, time: float, slack: np.ndarray | float = 0.0) -> None: ...

    def average(self) -> None: ...

    def velocity_gradient(self) -> np.ndarray: ...

    def frozen(self, values: np.ndarray): ...

    def turn(self, before: np.ndarray) -> None: ...

    def pace(self, at: float, time: float, dt: float): ...

    def lapse(self, time: float, dt: float, share: float) -> float: ...

    def comes_to_rest(self, time: float, dt: float) -> bool: ...


def advanced(history: dict[str, np.ndarray], *parts: tuple[float, dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """History plus the weighted rates, ``parts`` of (weight in s, rates); what gathers never becomes less, which leaves
    temperature free to fall."""
    def gained(name):
        change = sum(weight * rates[name] for weight, rates in parts)
        return change if name == "temperature" else np.maximum(change, 0.0)

    return {name: value + gained(name) for name, value in history.items()}


def drifting(flow: Flow, heat) -> Flow:
    """The flow with what conduction and exchange did to the temperatures in the step before (``heat.drift``) among its
    rates: what a scheme expects of them within a step."""
    return replace(flow, rates=flow.rates | {"temperature": flow.rates["temperature"] + heat.drift})


class Scheme:
    """What the schemes share: nothing to remember of the steps before.

    ``rotation``: every node turns by its local spin (``shifting.turned``), so that a spinning body keeps its size.
    """

    name: str
    look_ahead: float       # of the step, by the contact of the solve at its start

    def __init__(self, rotation: bool = False):
        self.rotation = rotation

    @classmethod
    def of(cls, choice) -> Scheme:
        """The scheme with the parameters of a scene (``scene.Shifting``)."""
        return cls(rotation=choice.rotation)

    def carried(self, body: Body, velocity: np.ndarray, dt: float, known_at: str) -> np.ndarray:
        """The velocity that carries the nodes for ``dt``; ``velocity`` is that of the present flow, at the "start",
        "middle" or "end" of the way."""
        if not self.rotation:
            return velocity
        return shifting.turned(velocity, body.velocity_gradient(), dt, known_at=known_at)

    def carry(self, body: Body, x0: np.ndarray, velocity: np.ndarray, dt: float, time: float) -> None:
        """Move the nodes from ``x0`` by ``dt`` with the mean velocity of the way, and the tools to ``time``; of a body
        that turns, the next solve starts from velocities that have turned along."""
        found_at = body.x.copy()
        body.x[:] = shifting.explicit(x0, velocity, dt)
        body.place(time)
        if self.rotation:
            body.turn(found_at)

    def memory(self) -> tuple[dict[str, float], dict[str, np.ndarray]]:
        """Numbers and nodal arrays that the next step needs of the steps before, by name."""
        return {}, {}

    def remember(self, numbers: dict[str, float], nodal: dict[str, np.ndarray]) -> None:
        """Take over what :meth:`memory` gave."""


class Explicit(Scheme):
    """x + v dt with the velocity of the start; first order, one solve a step."""

    name = "explicit"
    look_ahead = 1.0

    def advance(self, body: Body, start: Flow, time: float, history: dict, dt: float) -> StepEnd:
        start = body.pace(time, time, dt).of(start)
        self.carry(body, body.x.copy(), self.carried(body, start.velocity, dt, "start"), dt, time + dt)
        return StepEnd(advanced(history, (dt, start.rates)), 0, 0, None, np.inf)


class Rotation(Explicit):
    """The velocity of the start, turned by the local spin (``shifting.turned``); one solve a step.

    Rigid rotation is exact; second order in steady flow, first order where the flow changes with time.
    """

    name = "rotation"

    def __init__(self):
        super().__init__(rotation=True)

    @classmethod
    def of(cls, choice) -> Rotation:
        return cls()


class Etd2(Scheme):
    """The exponential shift; second order, exact for rigid rotation, one solve a step.

    The first step knows of no step before, from which the unsteady part would follow: it solves once more, half-way.
    Where rams slow down, unsteady is what changes with their way: the step before counts as if it had been as slow.
    """

    name = "etd2"
    look_ahead = 1.0

    def __init__(self):
        super().__init__()      # rotation is exact as it is
        self._memory: shifting.FlowMemory | None = None
        self._rates: dict[str, np.ndarray] = {}

    @classmethod
    def of(cls, choice) -> Etd2:
        return cls()

    def memory(self):
        last = self._memory
        if last is None:
            return {}, {}
        return {"dt": last.dt, "pace": last.pace}, \
            {"velocity": last.velocity, "gradient": last.gradient, "positions": last.positions,
             **{f"rate.{name}": rate for name, rate in self._rates.items()}}

    def remember(self, numbers, nodal):
        if nodal:
            self._memory = shifting.FlowMemory(nodal["velocity"], nodal["gradient"], nodal["positions"], **numbers)
            self._rates = {name.removeprefix("rate."): rate for name, rate in nodal.items() if name.startswith("rate.")}

    def advance(self, body: Body, start: Flow, time: float, history: dict, dt: float) -> StepEnd:
        start = body.pace(time, time, dt).of(start)
        x, gradient = body.x.copy(), start.share * body.velocity_gradient()
        memory, rates, middle = self._memory, self._rates, None
        if memory is None:      # half a step ahead instead of a step back
            middle = self._half_way(body, start, time, history, dt, x, gradient)
            memory = shifting.FlowMemory(middle.velocity, body.velocity_gradient(), body.x.copy(), -dt / 2)
            rates = middle.rates
        elif start.pace != memory.pace and 1.0 not in (start.pace, memory.pace):
            rates = {name: start.pace / memory.pace * rate for name, rate in rates.items()}
            memory = memory.at_pace(start.pace)
        body.x[:] = shifting.etd2(x, start.velocity, gradient, dt, memory)
        change = 0.5 * dt**2 / memory.dt      # the rates of the same material points: Adams-Bashforth
        parts = [(dt + change, start.rates), (-change, rates)]
        self._memory, self._rates = shifting.FlowMemory(start.velocity, gradient, x, dt, start.pace), start.rates
        body.place(time + dt)
        spent, solves = (0, 0) if middle is None else (middle.iterations, 1)
        return StepEnd(advanced(history, *parts), spent, solves, None, np.inf)

    def _half_way(self, body: Body, start: Flow, time: float, history: dict, dt: float, x, gradient) -> Flow:
        """The flow in the middle of the step; leaves the body there."""
        gaps = body.gaps()
        body.x[:] = shifting.etd2(x, start.velocity, gradient, dt / 2)
        body.place(time + dt / 2)
        return body.solve(time + dt / 2, advanced(history, (dt / 2, start.rates)), dt, gaps=gaps)


class Midpoint(Scheme):
    r"""Solve again half-way and move by that velocity; second order, two solves a step (the default).

    The velocity of the middle carries the nodes over the whole step, so what its contact may close is the gap of the start,
    :math:`g_0-\Delta t\,c_n\ge0`: a point that comes to a tool in the step is on it at the end, wherever the predictor
    has left it half-way. So the contact of the start, whose forces are recorded, looks ahead only over the half of the
    step in which its velocity is used: the farther it looks, the earlier landing points press.
    """

    name = "midpoint"
    look_ahead = 0.5

    def advance(self, body: Body, start: Flow, time: float, history: dict, dt: float) -> StepEnd:
        x0, gaps = body.x.copy(), body.gaps()
        half = body.lapse(time, dt, 0.5)
        there = time + half
        first, pace = body.pace(time, time, half).of(start), body.pace(there, time, dt)
        self.carry(body, x0, self.carried(body, first.velocity, half, "start"), half, there)
        middle = body.solve(there, advanced(history, (half, first.rates)), pace.share * dt, gaps=gaps)
        middle = pace.of(middle)
        self.carry(body, x0, self.carried(body, middle.velocity, dt, "middle"), dt, time + dt)
        error = dt * float(np.abs(middle.velocity - start.velocity).max())
        return StepEnd(advanced(history, (dt, middle.rates)), middle.iterations, 1, None, error)


class Trapezoid(Scheme):
    """The mean of the velocities at both ends, solved again on the end geometry until it no longer moves."""

    name = "trapezoid"
    look_ahead = 1.0

    def __init__(self, passes: int = 8, tolerance: float = 1e-5, rotation: bool = False):
        super().__init__(rotation)
        self.passes, self.tolerance = passes, tolerance

    def advance(self, body: Body, start: Flow, time: float, history: dict, dt: float) -> StepEnd:
        x0 = body.x.copy()
        size = np.ptp(x0, axis=0).max()
        end, spent, solves, error = start, 0, 0, np.inf
        start = body.pace(time, time, dt).of(start)
        first = self.carried(body, start.velocity, dt, "start")
        # where the tools turn at the end of the step: not yet turned; where they come to rest there: while there is a flow
        last = time + (1 - (GRADUAL if body.comes_to_rest(time, dt) else 1e-12)) * dt
        pace = body.pace(last, time, dt)
        body.average()
        target = shifting.explicit(x0, first, dt)
        for k in range(self.passes):
            body.x[:] = target
            body.place(last)
            end = body.solve(time + dt, advanced(history, (dt / 2, start.rates), (dt / 2, end.rates)), pace.share * dt)
            end = pace.of(end)
            spent, solves = spent + end.iterations, solves + 1
            corrected = shifting.explicit(x0, 0.5 * (first + self.carried(body, end.velocity, dt, "end")), dt)
            change = float(np.abs(corrected - target).max())
            error = change if k == 0 else error
            target = corrected
            if change < self.tolerance * size:
                break
        body.x[:] = target
        body.place(time + dt)
        return StepEnd(advanced(history, (dt / 2, start.rates), (dt / 2, end.rates)), spent, solves, None, error)
