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

from ..physics.gravity import GRAVITY
from ..physics.mass import Mass
from ..physics.parallel import highest
from .integration import Flow

BLOW = 1e-2          # of the step: in so short a time the given velocity adapts itself to the tools that touch at the start
CENTRED = 0.9        # of the way from the velocity at the end of a step to that of its middle: what rings dies out
UNLIKE = 0.3, 0.9    # relative difference of two half steps, up to which all of that way is gone, and from which none of it
SLOWER = 0.7         # in a step at most: the speed to which regularisation and penalty are relative
ROUNDING = 1e-9      # of a speed: a tool that closes in more slowly moves along with the body
SLOWEST = 1e-3       # of the greatest speed so far
STILL = 1e-12        # of the same: a body without weight that is slower everywhere has come to rest
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
    is_start : whether the last flow is that of the start, or of a tool that starts at a body at rest, whose loads are not
        defined
    """

    def __init__(self, mass: Mass, velocity: np.ndarray, free: np.ndarray):
        self.mass, self._free = mass, free
        self.now: Moment | None = None
        self.before = Moment(-np.inf, velocity)
        self.is_start = True
        self._of_start = _Sums(mass.momentum(velocity), {"kinetic": mass.kinetic_energy(velocity)})
        self._settled = self._last = _Sums(np.zeros(mass.nodes.dim), {})    # a second solve at a time replaces the last
        self._half: tuple[Moment, _Sums, float] | None = None   # where a step began, what its first half booked, its middle
        self._carried: np.ndarray | None = None     # after a change of mesh: of the last flow, what it carries besides
        self._most_momentum = np.abs(self._of_start.impulse)
        self._kept: tuple[np.ndarray, float] | None = None      # momentum and kinetic energy before that change
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
        return self.mass.properties.weight or fastest > STILL * self._greatest

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
        if self.now is not None and time - self.now.time > 1e-9 * dt:
            self.before, self.is_start, self._speed_before = self.now, False, self._speed
            self._settled, self._last = self._settled + self._last, self._last.nothing()
        elif self.now is None or time - self.before.time < 1e-9 * dt:      # no time has passed: a blow
            self.before, self.is_start = Moment(time - BLOW * dt, self.velocity), True
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

    def found(self, body, time: float, halfway: bool) -> None:
        """Book the flow that a solve of ``body`` has found at ``time``, which is ``halfway`` through a step or its end."""
        velocity = body.workpiece.velocity
        if self._carried is not None:
            self._on_new_mesh(time, velocity)
            return
        self.now = Moment(time, velocity)
        powers, force = body.powers(), self.mass.weight_force()
        for tool in body.tools:
            force = force + body.contact.force(tool)
        energies = {name: float(self.interval * powers[name]) for name in (*GIVEN, *TAKEN) if name in powers}
        taken = "first impact" if self.is_start else "stepping"
        energies[taken] = float(self.mass.kinetic_energy(velocity - self.before.velocity))
        self._last = _Sums(self.interval * force, energies)
        self._most_momentum = np.maximum(self._most_momentum, np.abs(self.mass.momentum(velocity)))
        if self.is_start:
            self._forget_loads(body)
        elif halfway:
            self._half = self.before, self._last, time
        elif self._half is not None and self._half[2] == self.before.time:
            self._centre(*self._half[:2])

    def _centre(self, start: Moment, first: _Sums) -> None:
        r"""Carry on with the velocity that belongs to the middle of the step, as far as the motion is smooth.

        Two half steps of backward Euler, :math:`v_0\to v_m\to v_e`, are of first order; :math:`2v_m-v_0` is of second and
        keeps the energy, but throws back what has landed. The share of the way to it comes from what the two half steps
        have in common. Energies and impulse follow exactly: both ends obey their balance, and kinetic energy is quadratic.
        """
        mass, end = self.mass, self.now
        ways = [self.before.velocity - start.velocity, end.velocity - self.before.velocity]
        bend = ways[0] - ways[1]        # 2 v_m - v_0 - v_e
        greatest = max(mass.kinetic_energy(way) for way in ways)
        if greatest == 0.0:
            return
        unlike = np.sqrt(mass.kinetic_energy(bend) / greatest)
        share = CENTRED * float(np.clip((UNLIKE[1] - unlike) / (UNLIKE[1] - UNLIKE[0]), 0.0, 1.0))
        self.now = Moment(end.time, end.velocity + share * bend)
        second = self._last
        energies = {n: e + share * (first.energies[n] - e) for n, e in second.energies.items() if n != "stepping"}
        stepping = (1.0 - share) * second.energies["stepping"] - share * first.energies["stepping"] + \
            share * (1.0 - share) * mass.kinetic_energy(bend)
        self._last = _Sums(second.impulse + share * (first.impulse - second.impulse),
                           energies | {"stepping": float(stepping)})

    def _on_new_mesh(self, time: float, velocity: np.ndarray) -> None:
        """The flow of the last solve anew, on another mesh: the momentum stays, and the kinetic energy is booked."""
        momentum, energy = self._kept
        carried = velocity + self._carried
        carried = carried + np.where(self._free, (momentum - self.mass.momentum(carried)) / self.mass.total(), 0.0)
        self.now = Moment(time, carried)
        lost = {"remeshing": float(energy - self.mass.kinetic_energy(carried))}
        self._last, self._carried = self._last + _Sums(0.0 * self._last.impulse, lost), None

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
        ``dt``, of deformation, of a free fall through a step, which where a tool drives ends on the tool below; it sinks
        slowly, lest they change from solve to solve.

        ``trace`` : nodal values (nodes, dim) → at the contact points. Collective.
        """
        whole, deforming = self.mass.speeds(self.velocity)
        landing = self.landing_speed(tools, trace, dt)
        falling = GRAVITY * dt if self.mass.properties.weight else 0.0
        if falling and tool_speed:
            falling = min(falling, np.sqrt(2.0 * GRAVITY * self._room_below(tools)))
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

    def _room_below(self, tools) -> float:
        """How far the body can fall before a point of it lands, mm; infinite above nothing. Collective."""
        room = np.inf
        for tool in tools:
            up = tool.state.normal[:, -1]
            below = up > 0
            room = min(room, float((tool.state.gap[below] / up[below]).min(initial=np.inf)))
        return max(0.0, -highest(self.mass.nodes.comm, -room))

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
        """The greatest that the run has seen, of each component, (dim,) N s."""
        return self._most_momentum

    def momentum_error(self) -> np.ndarray:
        """Momentum less that of the start and the impulse of tools and weight, (dim,) N s. Collective."""
        return self.momentum() - self._of_start.impulse - (self._settled + self._last).impulse

    # ------------------------------------------------------------------ going back, going on
    def snapshot(self) -> dict:
        """What a failed step must give back."""
        return {name: value for name, value in vars(self).items() if name not in ("mass", "_free", "_surface_mass")}

    def restore(self, snapshot: dict) -> None:
        vars(self).update(snapshot)

    def memory(self) -> tuple[dict, dict[str, np.ndarray]]:
        """Numbers and nodal arrays, by name, that a run goes on from."""
        began, first, _ = self._half or (self.before, self._last, 0.0)
        sums = {name: {"impulse": s.impulse.tolist(), "energies": s.energies} for name, s in
                (("start", self._of_start), ("settled", self._settled), ("last", self._last), ("first", first))}
        numbers = {"times": [began.time, self.before.time, self.now.time], "is_start": self.is_start, "sums": sums,
                   "most_momentum": self._most_momentum.tolist(),
                   "speeds": [self._speed, self._speed_before, self._greatest], "surface_mass": self._surface_mass,
                   "has_halves": self._half is not None and self._half[2] == self.before.time}
        velocities = {"began": began, "before": self.before, "now": self.now}
        return numbers, {f"{name}.velocity": moment.velocity for name, moment in velocities.items()}

    def remember(self, numbers: dict, nodal: dict[str, np.ndarray]) -> None:
        """Take over what :meth:`memory` gave."""
        velocities = [nodal[f"{name}.velocity"] for name in ("began", "before", "now")]
        began, self.before, self.now = (Moment(*both) for both in zip(numbers["times"], velocities, strict=True))
        self._of_start, self._settled, self._last, first = (
            _Sums(np.array(numbers["sums"][n]["impulse"]), numbers["sums"][n]["energies"])
            for n in ("start", "settled", "last", "first"))
        self._half = (began, first, self.before.time) if numbers["has_halves"] else None
        self.is_start, self._most_momentum = numbers["is_start"], np.array(numbers["most_momentum"])
        self.remember_speeds(numbers)
        self._surface_mass = numbers["surface_mass"]

    def remember_speeds(self, numbers: dict) -> None:
        """Take over the speeds alone: a search, which finds its own, may have come between."""
        self._speed, self._speed_before, self._greatest = numbers["speeds"]

    def continues(self, other: Inertia, before: np.ndarray, now: np.ndarray, flow: np.ndarray) -> None:
        """Go on as ``other`` did on another mesh, from whose nodes the velocities before, now and of the last flow were
        taken over, (nodes, dim); the last flow is to be found anew. The mass stays, and so does the momentum. Collective.
        """
        self.restore(other.snapshot())
        self.mass.keep_total(other.mass.total())
        lost = other.mass.momentum(other.before.velocity) - self.mass.momentum(before)
        before = before + np.where(self._free, lost / self.mass.total(), 0.0)
        self.before, self.now = Moment(other.before.time, before), Moment(other.now.time, now)
        self._carried, self._half = now - flow, None
        self._kept = other.momentum(), other.mass.kinetic_energy(other.velocity)


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
