r"""From one velocity solve to the next of a body with inertia: the velocity before, and where the energy went.

Every solve at a time t is a step of the backward Euler rule from the solve before it, whatever the time scheme asks for
in between: :math:`K v + M (v-v_{before})/\Delta t = F`. The nodes follow the material, so this is the material
acceleration. With the powers P of that solve the energies obey, to what its Newton leaves,

.. math:: T(v) - T(v_{before}) + \tfrac12 (v-v_{before})^T M (v-v_{before})
          = \Delta t\,(P_{tools}+P_{weight}-P_{plastic}-P_{friction}-P_{penalty}) ,

the last term on the left being what a change of velocity within a step takes ("stepping"): blows that are over so soon, and
the damping of the rule, which is of first order in the step. The first solve has no velocity before it but the given one,
and no interval: its loads are an impulse that is over at once (:data:`BLOW`), "first impact" the energy that this takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..physics.mass import GRAVITY, Mass
from ..physics.parallel import highest
from .integration import Flow

BLOW = 1e-2          # of the step: in so short a time the given velocity adapts itself to the tools that touch at the start
SLOWER = 0.7         # in a step at most: the speed to which regularisation and penalty are relative
ROUNDING = 1e-9      # of a speed: a tool that closes in more slowly moves along with the body
SLOWEST = 1e-3       # of the greatest speed so far
GIVEN = ("tools", "weight")
TAKEN = ("plastic", "friction", "penalty", "first impact", "stepping", "remeshing")


@dataclass(frozen=True)
class Moment:
    """A time, s, and the nodal velocities (nodes, dim) then, mm/s."""

    time: float
    velocity: np.ndarray


class Inertia:
    """What a body with mass knows of its motion.

    Parameters
    ----------
    mass : of the workpiece
    velocity : (nodes, dim) mm/s, at the start
    free : (dim,) of bool, directions in which nothing but tools holds the body

    Attributes
    ----------
    now, before : the last solve, and the one from whose velocity it started
    is_start : whether the last flow is that of the start, whose loads are not defined
    """

    def __init__(self, mass: Mass, velocity: np.ndarray, free: np.ndarray):
        self.mass, self._free = mass, free
        self.now: Moment | None = None
        self.before = Moment(-np.inf, velocity)
        self.is_start = True
        self._of_start = _Sums(mass.momentum(velocity), {"kinetic": mass.kinetic_energy(velocity)})
        self._settled = self._last = _Sums(np.zeros(mass.nodes.dim), {})    # a second solve at a time replaces the last
        self._speed = self._speed_before = self._greatest = 0.0
        self._surface_mass: float | None = None

    @property
    def velocity(self) -> np.ndarray:
        """The last known velocities, (nodes, dim) mm/s."""
        return (self.now or self.before).velocity

    @property
    def interval(self) -> float:
        """Time between the last two solves, s."""
        return self.now.time - self.before.time

    def moves(self) -> bool:
        """Whether the body moves by itself: by its weight, or because it did so before. Collective."""
        fastest = highest(self.mass.nodes.comm, float(np.abs(self.velocity).max(initial=0.0)))
        return self.mass.properties.weight or fastest > 0.0

    # ------------------------------------------------------------------ a solve
    def starts_freely(self, body, dt: float) -> bool:
        """Whether this is the first flow of ``body`` and no point lands within ``dt``: it is the given one. Collective."""
        return self.now is None and (body.contact is None or
                                     self.landing_speed(body.tools, body.contact.facets.trace, dt) == 0.0)

    def first_flow(self, body, time: float, history: dict) -> Flow:
        """The flow with the given velocities, which nothing changes at ``time``."""
        self.now = self.before = Moment(time, self.before.velocity)
        w = body.workpiece
        w.set_start(self.before.velocity, np.zeros(body.nodes.count))
        w.refresh_strain_rate()
        w.stress_is_unknown = True
        w.keep_rate(w.point_rate(), body.speed / body.height())
        return Flow(w.velocity, body.rates(history), 0)

    def begin(self, body, time: float, dt: float) -> None:
        """Make ready for the solve of ``body`` at ``time``; ``dt`` is the step that it belongs to, s."""
        if self.now is None:
            self.before = Moment(time - BLOW * dt, self.before.velocity)
        elif time - self.now.time > 1e-9 * dt:
            self.before, self.is_start, self._speed_before = self.now, False, self._speed
            self._settled, self._last = self._settled + self._last, self._last.nothing()
        self.mass.start_from(self.before.velocity, time - self.before.time)
        if self.now is None and body.workpiece.is_cold:
            body.workpiece.set_start(self.before.velocity, np.zeros(body.nodes.count))
            body.workpiece.stress_is_unknown = True
        if body.contact is not None:
            body.contact.inertia = self._penalty(body)

    def _penalty(self, body) -> float:
        """What the mass that lands adds to the penalty, N s/mm³."""
        if self._surface_mass is None:
            self._surface_mass = body.contact.surface_mean(self.mass.diagonal(), body.workpiece.nodal_areas())
        return body.workpiece.settings.penalty_factor * self._surface_mass * float(self.mass.per_step.value)

    def found(self, body, time: float) -> None:
        """Book the flow that a solve of ``body`` has found at ``time``."""
        velocity = body.workpiece.velocity
        self.now = Moment(time, velocity)
        powers, force = body.powers(), self.mass.weight_force()
        for tool in body.tools:
            force = force + body.contact.force(tool)
        energies = {name: float(self.interval * powers[name]) for name in (*GIVEN, *TAKEN) if name in powers}
        taken = "first impact" if self.is_start else "stepping"
        energies[taken] = float(self.mass.kinetic_energy(velocity - self.before.velocity))
        self._last = _Sums(self.interval * force, energies)
        if self.is_start:
            self._forget_loads(body)

    def _forget_loads(self, body) -> None:
        """Of the blow at the start only the velocities are of use: its stresses are those of an impulse."""
        for part in body.workpiece.contacts:
            part.release()
        w = body.workpiece
        w.set_start(w.velocity, np.zeros(body.nodes.count))

    def rest(self, time: float) -> None:
        """Nothing moves at ``time``."""
        self.now = self.before = Moment(time, np.zeros_like(self.before.velocity))

    # ------------------------------------------------------------------ how fast things go
    def speed(self, tools, trace, tool_speed: float, dt: float) -> float:
        """The speed that regularisation and penalty are relative to, mm/s: of the tools, of points that land within
        ``dt``, of deformation, of a free fall through a step; it sinks slowly, lest they change from solve to solve.

        ``trace`` : nodal values (nodes, dim) → at the contact points. Collective.
        """
        whole, deforming = self.mass.speeds(self.velocity)
        landing = self.landing_speed(tools, trace, dt)
        falling = GRAVITY * dt if self.mass.properties.weight else 0.0
        found = max(tool_speed, landing, deforming, falling)
        self._greatest = max(self._greatest, found, whole)
        self._speed = max(found, SLOWER * self._speed_before, SLOWEST * self._greatest)
        return self._speed

    def landing_speed(self, tools, trace, dt: float) -> float:
        """Greatest speed at which points close in on a tool that they reach within ``dt``, mm/s; 0 if none. Collective."""
        fastest = 0.0
        for tool in tools:
            closing = np.einsum("pi,pi->p", tool.state.tool_velocity - trace(self.velocity), tool.state.normal)
            size = np.sqrt(np.einsum("pi,pi->p", tool.state.tool_velocity, tool.state.tool_velocity))
            lands = (closing * dt > tool.state.gap) & (closing > ROUNDING * size)
            fastest = max(fastest, float(closing[lands].max(initial=0.0)))
        return highest(self.mass.nodes.comm, fastest)

    # ------------------------------------------------------------------ ledgers
    def energies(self) -> dict[str, float]:
        """Where the energy came from and went, mJ: "start", work of tools and weight, what was taken, "kinetic" now, and
        the "imbalance" that is left. Of the modelled part. Collective."""
        done = (self._settled + self._last).energies
        found = {"start": self._of_start.energies["kinetic"]} | {n: done.get(n, 0.0) for n in (*GIVEN, *TAKEN)}
        found["kinetic"] = self.mass.kinetic_energy(self.velocity)
        found["imbalance"] = found["start"] + sum(found[n] for n in GIVEN) - sum(found[n] for n in (*TAKEN, "kinetic"))
        return found

    def momentum(self) -> np.ndarray:
        """Momentum of the modelled part now, (dim,) N s. Collective."""
        return self.mass.momentum(self.velocity)

    def greatest_momentum(self) -> np.ndarray:
        """That of the start, the impulse or that of now, the greatest of each, (dim,) N s. Collective."""
        impulse = (self._settled + self._last).impulse
        return np.abs([self._of_start.impulse, impulse, self.momentum()]).max(axis=0)

    def momentum_error(self) -> np.ndarray:
        """Momentum less that of the start and the impulse of tools and weight, (dim,) N s. Collective."""
        return self.momentum() - self._of_start.impulse - (self._settled + self._last).impulse

    # ------------------------------------------------------------------ going back, going on
    def snapshot(self) -> dict:
        """What a failed step must give back."""
        return {name: value for name, value in vars(self).items() if name not in ("mass", "_free", "_surface_mass")}

    def restore(self, snapshot: dict) -> None:
        vars(self).update(snapshot)

    def memory(self) -> tuple[dict, dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Numbers, nodal arrays and values per cell, by name, that a run goes on from."""
        sums = {name: {"impulse": s.impulse.tolist(), "energies": s.energies} for name, s in
                (("start", self._of_start), ("settled", self._settled), ("last", self._last))}
        numbers = {"times": [self.before.time, self.now.time], "is_start": self.is_start, "sums": sums,
                   "speeds": [self._speed, self._speed_before, self._greatest]}
        return numbers, {"before.velocity": self.before.velocity, "now.velocity": self.now.velocity}, \
            {"mass": self.mass.of_points}

    def remember(self, numbers: dict, nodal: dict[str, np.ndarray], cellwise: dict[str, np.ndarray]) -> None:
        """Take over what :meth:`memory` gave."""
        before, now = numbers["times"]
        self.before, self.now = Moment(before, nodal["before.velocity"]), Moment(now, nodal["now.velocity"])
        self.is_start = numbers["is_start"]
        self._of_start, self._settled, self._last = (
            _Sums(np.array(s["impulse"]), s["energies"]) for s in map(numbers["sums"].get, ("start", "settled", "last")))
        self._speed, self._speed_before, self._greatest = numbers["speeds"]
        self.mass.of_points[:] = cellwise["mass"].reshape(self.mass.of_points.shape)
        self.mass.follow()

    def continues(self, other: Inertia, before: np.ndarray, now: np.ndarray) -> None:
        """Go on as ``other`` did on another mesh, from whose nodes the two velocities (nodes, dim) were taken over.

        The mass stays, and so does the momentum of the velocities before; what the transfer does to their kinetic energy is
        booked. Collective.
        """
        self.mass.keep_total(other.mass.total())
        lost = other.mass.momentum(other.before.velocity) - self.mass.momentum(before)
        before = before + np.where(self._free, lost / self.mass.total(), 0.0)
        lost = other.mass.kinetic_energy(other.before.velocity) - self.mass.kinetic_energy(before)
        self.restore(other.snapshot())
        self.before, self.now = Moment(other.before.time, before), Moment(other.now.time, now)
        self._settled = self._settled + _Sums(0.0 * self._settled.impulse, {"remeshing": lost})


@dataclass(frozen=True)
class _Sums:
    """Impulse (dim,), N s, and energies by name, mJ."""

    impulse: np.ndarray
    energies: dict[str, float]

    def __add__(self, other: _Sums) -> _Sums:
        names = {**self.energies, **other.energies}
        return _Sums(self.impulse + other.impulse,
                     {name: self.energies.get(name, 0.0) + other.energies.get(name, 0.0) for name in names})

    def nothing(self) -> _Sums:
        return _Sums(0.0 * self.impulse, {})
