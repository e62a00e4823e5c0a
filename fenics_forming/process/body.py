"""A flowing body between its tools at a given time: what the time schemes act on."""

from __future__ import annotations

from functools import partial
from time import perf_counter

import numpy as np

from ..errors import ConvergenceError
from ..physics.contact.rigid import RigidContact, ToolMotion
from ..physics.gravity import GRAVITY
from ..physics.newton import FlowSolver
from ..physics.parallel import highest, lowest, total
from ..physics.workpiece import Workpiece
from .approach import NEAR, time_to_contact
from .frozen import FrozenField
from .integration import Flow
from .machines import Rams
from .moving import follow_weight
from .shifting import put_on_tools
from .volume import FreeSurface, Restored

HOVER = 2e-4   # of the size of a contact facet: a pressed node that hovers less than this above its tool is on it


# How far a solve is implicit in hardening and change of shape (workpiece.RateContinuity). Without it the flow of a
# smooth, perfectly plastic block in plane strain is left to chance (bands, 1 to 5 % of the force); with these values it is
# the uniform one from 20 to 200 steps, and the sticking billet changes by 0.3 % at 60 %.
TIE = 0.75          # share of the step
LEAST_TIE = 0.03    # and at least over this strain increment


class FlowingBody:
    """Workpiece, solver, tools and drives together; implements ``integration.Body``.

    Parameters
    ----------
    workpiece : terms and spaces (its ``contact`` may be None)
    drives : tool name → drive of ``laws.equipment``; tools that are not named rest
    boundary : (n,) nodes that a tool may touch
    height_axis : the axis along which the main tool moves; the extent on it makes the characteristic rate
    temperature : degC, or None; of several bodies (nodes,)
    damage : law of ``laws.damage``, or None: no damage gathers
    free_surface : of the same nodes, to measure and restore the volume by
    surfaces : the same by name, where there are several bodies
    initial_velocity : (nodes, dim) mm/s at the start; given where inertia acts, and only there
    heat : ``heating.BodyHeat``, where temperatures change, or None; then they are part of the history
    """

    def __init__(self, workpiece: Workpiece, *, drives: dict, boundary: np.ndarray, height_axis: int,
                 temperature: float | np.ndarray | None = None, damage=None, free_surface: FreeSurface | None = None,
                 surfaces: dict[str, FreeSurface] | None = None, initial_velocity: np.ndarray | None = None,
                 heat=None):
        self.workpiece, self.nodes = workpiece, workpiece.nodes
        self.solver = FlowSolver(workpiece)
        self.contact: RigidContact | None = workpiece.contact
        self.tools = self.contact.tools if self.contact is not None else []
        self._drives, self.boundary, self.height_axis = drives, boundary, height_axis
        self.rams = Rams(drives)
        self.interfaces, self.parts = workpiece.interfaces, workpiece.parts
        self.free_surface, self.surfaces = free_surface, surfaces or {}
        self._temperature = None if temperature is None else np.full(self.nodes.count, temperature, float)
        self._damage, self.heat = damage, heat
        self._held = workpiece.held()
        self._held_at = self.x[self._held]
        self.size = float(np.ptp(self.nodes.extents(), axis=0).max())
        self.seconds = {"contact search": 0.0, "shifting": 0.0}
        self.speed = self.solved_speed = 0.0     # of the tools: at the last search, and in the flow found last
        self.reach = HOVER * workpiece.contact.facets.size() if workpiece.contact is not None else 0.0
        self.sunk = 0.0
        self.inertia = None
        if initial_velocity is not None:
            from .inertia import Inertia
            held = highest(self.nodes.comm, self._held.any(axis=0).astype(float)) > 0
            self.inertia = Inertia(workpiece.mass, initial_velocity, ~held)
        self._flows_by_itself = not {"body_force", "weight"}.isdisjoint(workpiece.terms) or \
            any(callable(c.value) or c.value != 0 for c in workpiece.fixed)
        self.move_tools(0.0)       # not placed yet: of a run that goes on, tools may stand elsewhere
        self._as_shifted = self.x[self.boundary]

    @property
    def x(self) -> np.ndarray:
        return self.nodes.x

    # ------------------------------------------------------------------ tools
    def move_tools(self, time: float) -> None:
        """Put every tool where its drive has it at ``time``."""
        for tool in self.tools:
            tool.motion = motion_of(self._drives.get(tool.name), time, self.nodes.dim)
            if tool.free is not None:
                tool.motion = tool.free.moved(tool.motion, time)

    def settle(self, time: float) -> None:
        """A step has ended at ``time``: what tools have moved by themselves is where their next motions start."""
        self.rams.arrive(self.tools, time)
        for tool in self.tools:
            if tool.free is not None:
                tool.free.settle(time)
            if tool.deformation is not None:
                tool.deformation.settle()

    @property
    def deformations(self) -> list:
        """Of the tools that yield (``process.tool_deformation``)."""
        return [tool.deformation for tool in self.tools if tool.deformation is not None]

    def place(self, time: float, slack: np.ndarray | float = 0.0) -> None:
        """Move the tools to ``time`` and put boundary nodes that have sunk into one back onto it; nodes of mirror planes
        stay on them, whatever a recovered gradient made of their velocities.

        ``slack`` (nodes,), mm: how much farther than usual a pressed node may hover and still be drawn onto its tool.
        """
        start = perf_counter()
        self.move_tools(time)
        held = self._pressed_nodes()
        self.x[self._held] = self._held_at
        self._as_shifted = self.x[self.boundary]
        reach = self.reach + np.broadcast_to(slack, len(self.x))[self.boundary]
        self.sunk = put_on_tools(self.x, self.tools, self.boundary, held, reach) if self.tools else 0.0
        self.seconds["shifting"] += perf_counter() - start

    def _pressed_nodes(self) -> dict[str, np.ndarray]:
        return self.contact.pressed_nodes() if self.tools and not self.workpiece.is_cold else {}

    # ------------------------------------------------------------------ volume
    def returned_volume(self) -> float:
        """Change of volume, mm³, by the nodes that the last placing put back onto the tools. Collective."""
        moved = (self.x[self.boundary] != self._as_shifted).any()
        if not highest(self.nodes.comm, float(moved)):
            return 0.0
        shifted = self._before_placing()
        return self.free_surface.volume(self.x) - self.free_surface.volume(shifted)

    def returned_volumes(self) -> dict[str, float]:
        """The same of several bodies, by name. Collective."""
        shifted = self._before_placing()
        return {name: s.volume(self.x) - s.volume(shifted) for name, s in self.surfaces.items()}

    def volumes(self) -> dict[str, float]:
        """Volumes of several bodies now, mm³ (mm² in plane strain), by name. Collective."""
        return {name: surface.volume(self.x) for name, surface in self.surfaces.items()}

    def skins(self) -> list[tuple[FreeSurface, np.ndarray]]:
        """The free surface of every body, and its cells of this rank, (cells, nodes of a cell)."""
        if self.free_surface is not None:
            return [(self.free_surface, self.nodes.cells)]
        return [(surface, self.nodes.cells[self.parts.cells_of(name)]) for name, surface in self.surfaces.items()]

    def _before_placing(self) -> np.ndarray:
        shifted = self.x.copy()
        shifted[self.boundary] = self._as_shifted
        return shifted

    def restore_volume(self, volume: float) -> Restored:
        """Offset the free surface until the body has the given volume, mm³; pressed nodes stay. Collective."""
        start = perf_counter()
        pressed = sum(self._pressed_nodes().values(), np.zeros(self.nodes.count, bool))
        done = self.free_surface.offset_to(volume, self.x, self.tools, pressed=pressed)
        self.seconds["shifting"] += perf_counter() - start
        return done

    def making(self) -> dict | None:
        """How several bodies share the mesh: cells of each, and which of two in contact holds the points."""
        if self.parts is None:
            return None
        return {"cells": self.parts.counts, "slaves": {} if self.interfaces is None else self.interfaces.slaves}

    def between(self) -> dict[str, tuple] | None:
        """Pair of bodies → the points of their contact, and what the next solve starts from there, (points, k)."""
        if self.interfaces is None:
            return None
        memory = self.interfaces.memory()
        return {name: (contact.points, {"state": memory[name]}) for name, contact in self.interfaces.by_name.items()}

    # ------------------------------------------------------------------ contact
    def gaps(self) -> dict[str, np.ndarray]:
        """Tool or pair of bodies → (points,) the gaps of the last search at the contact points, mm."""
        of_tools = {tool.name: tool.state.gap for tool in self.tools}
        return of_tools if self.interfaces is None else of_tools | self.interfaces.gaps()

    def search(self, dt: float) -> None:
        """Closest points of the contact facets; ``dt`` is what contact looks ahead."""
        if self.contact is None:
            self.speed = self.speed if self.inertia is None else self.inertia.speed([], None, 0.0, dt)
            return
        start = perf_counter()
        self.contact.search(self.x, dt)
        if self.workpiece.is_cold:
            self.contact.let_go()
        speed = self.tool_speed()
        if self.inertia is not None:
            speed = self.inertia.speed(self.tools, self.contact.facets.trace, speed, dt)
        if speed > 0:
            self.speed = speed
        elif self.speed == 0.0 and self.workpiece.mass is not None:
            self.speed = GRAVITY * dt       # nothing moves yet but what falls
        self.contact.set_speed(self.speed)
        if self.interfaces is not None:
            self.interfaces.search(self.x, dt, self.speed)
        self.seconds["contact search"] += perf_counter() - start

    def tool_speed(self) -> float:
        """Greatest speed of a tool at the contact points, mm/s; of one that yields also that of its drive."""
        fastest = max((float(np.sqrt((v**2).sum(axis=1)).max(initial=0.0)) for t in self.tools
                       for v in t.velocities()), default=0.0)
        return highest(self.nodes.comm, fastest)

    def is_pushed(self, dt: float) -> bool:
        """Whether something makes the body flow: a tool that touches it and closes in or turns, or, of a body that
        flows already, one that lands on it within ``dt``.

        Otherwise rest is the solution: a tool that stands still, withdraws or slides along presses nothing.
        """
        if self.contact is None or self._flows_by_itself or self.inertia is not None and self.inertia.moves():
            return True
        touch, size = self.time_to_contact(dt), NEAR * self.size
        turns = any(t.motion.angular_velocity != 0 and (t.state.gap <= size).any() for t in self.tools)
        pushed = touch <= 1e-9 * dt if self.workpiece.is_cold else touch < dt
        pushed = pushed or highest(self.nodes.comm, float(self.contact.is_loaded(size))) > 0
        return pushed or highest(self.nodes.comm, float(turns)) > 0

    def time_to_contact(self, horizon: float) -> float:
        """Time until the first tool touches the body, s; 0 where one touches already. Collective."""
        return time_to_contact(self, horizon)

    # ------------------------------------------------------------------ flow
    def height(self) -> float:
        """Extent of the body along the working direction, mm."""
        return float(np.ptp(self.nodes.extents(), axis=0)[self.height_axis])

    def time_to_height(self, wanted: float, velocity: np.ndarray, horizon: float) -> float:
        """Time in which the nodal velocities (nodes, dim) bring the height to ``wanted``, s; at most ``horizon``."""
        now, time = self.height(), horizon
        for _ in range(3):      # secants: the height is convex in time
            along = self.x[:, self.height_axis] + time * velocity[:, self.height_axis]
            comm = self.nodes.comm
            then = highest(comm, float(along.max(initial=-np.inf))) - lowest(comm, float(along.min(initial=np.inf)))
            if then >= wanted:
                break
            time *= (now - wanted) / (now - then)
        return time

    def solve(self, time: float, history: dict[str, np.ndarray], dt: float, *, ahead: float = 1.0,
              gaps: dict[str, np.ndarray] | None = None) -> Flow:
        """Flow at ``time`` on the present geometry, rest where nothing pushes the body.

        dt : step to which the solve belongs, s; the rates are tied over it
        ahead : share of it that contact looks ahead
        gaps : what contact has to close instead of the present gaps (:meth:`gaps`), mm

        Raises
        ------
        ConvergenceError
            if a cell is inverted or the velocities do not converge.
        """
        if self.inverted():
            raise ConvergenceError("a cell of the mesh is inverted", advice="the mesh is too distorted: try smaller "
                                   "steps, a coarser mesh near the fold, or stop earlier")
        flow = self._flow(time, history, dt, ahead, gaps)
        self.rams.feel(self.contact, time)
        return flow

    def _flow(self, time: float, history: dict, dt: float, ahead: float, gaps: dict | None) -> Flow:
        self.search(ahead * dt)
        for tool in self.tools if gaps is not None else ():
            tool.state.gap = gaps[tool.name]
        if gaps is not None and self.interfaces is not None:
            self.interfaces.set_gaps(gaps)
        if not self.is_pushed(ahead * dt):
            if self.inertia is not None:
                self.inertia.rest(time)
            return self.rest()
        characteristic_rate = self.speed / self.height()
        if self.inertia is not None:
            if self.inertia.starts_freely(self, ahead * dt):
                return self.inertia.first_flow(self, time, history)
            self.inertia.begin(self, time, dt)
            tied = None         # inertia says which of all possible flows it is, and rates may jump
        else:
            if self.workpiece.mass is not None:
                follow_weight(self)
            tied = max(TIE * dt, LEAST_TIE / max(characteristic_rate, self._mean_rate(characteristic_rate)))
            self._follow_speed()
        solve = partial(self.solver.solve, strain=history["effective_strain"], characteristic_rate=characteristic_rate,
                        step=tied, temperature=self.temperature_in(history), touching=NEAR * self.size)
        border = self.solver.border
        once = lambda: (solve() if border is None else border.solved(solve)).iterations  # noqa: E731
        try:
            iterations = once()
            if self.deformations and ahead == 1.0:       # only those that take the tools along
                from .tool_deformation import agree
                iterations += agree(self, once)
        except ConvergenceError as failure:
            raise self._explained(failure) from failure
        if self.inertia is not None:
            self.inertia.found(self, time, halfway=gaps is not None)
        return Flow(self.workpiece.velocity, self.rates(history), iterations)

    def _follow_speed(self) -> None:
        """Let the flow of the solve before start the next one faster or slower, as the tools have become: on a crank, whose
        speed changes in every step, that is 4 instead of 20 iterations."""
        if not self.workpiece.is_cold and self.solved_speed > 0 and self.speed != self.solved_speed:
            self.workpiece.solution.x.array[self.workpiece.velocity_dofs] *= self.speed / self.solved_speed
        self.solved_speed = self.speed

    def _mean_rate(self, characteristic_rate: float) -> float:
        """Effective strain rate of the solve before, 1/s, where the body flows: its mean weighted by itself.

        Of a body that flows as a whole it is about the characteristic rate; in an extrusion, where only a small part
        flows at a time, it is much higher. Collective.
        """
        if self.workpiece.last_rate is None:
            return 0.0
        rate, before = self.workpiece.last_rate
        rate = rate.reshape(len(self.nodes.cells), -1)
        size = self.nodes.cell_sizes()[:, None]
        sums = total(self.nodes.comm, np.array([(size * rate**2).sum(), (size * rate).sum()]))
        return float(sums[0] / sums[1]) * characteristic_rate / before if sums[1] > 0 else 0.0

    def new_history(self) -> dict[str, np.ndarray]:
        """What the material carries along, by name and node, at the start: nothing has gathered yet."""
        names = ["effective_strain"] + ["damage"] * (self._damage is not None)
        history = {name: np.zeros(self.nodes.count) for name in names}
        return history if self.heat is None else history | {"temperature": self._temperature}

    def gathering(self, history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The history with places for what a step gathers besides it: the heat that is made."""
        return history if self.heat is None else history | self.heat.gathering()

    def rates(self, history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Rates of the history in the present flow, by name and node, 1/s."""
        rates = {"effective_strain": self.workpiece.nodal_rate()}
        if self._damage is not None:
            strain = history["effective_strain"]
            rates["damage"] = self.workpiece.nodal_damage_rate(self._damage, strain, self.temperature_in(history))
        if self.heat is not None:
            made = self.heat.rates()
            rates |= made | {"temperature": self.heat.warming(made)}
        return rates

    def _explained(self, failure: ConvergenceError) -> ConvergenceError:
        """The failure, and its likely reason where one tool alone touches the body and nothing is on its far side."""
        if self.contact is None:
            return failure
        pushes = {t.name: self.contact.facets.integral(
            (t.state.gap <= NEAR * self.size)[:, None] * t.state.normal * self.contact.weights[:, None])
            for t in self.tools}
        pushes = {name: push for name, push in pushes.items() if np.any(push != 0)}
        held = {c.component for c in self.workpiece.fixed}
        if len(pushes) != 1 or any(int(np.argmax(np.abs(push))) in held for push in pushes.values()):
            return failure
        return ConvergenceError(f"{failure.sentence}; of the tools only '{next(iter(pushes))}' touches the body",
                                history=failure.history, advice="if the body is free to move away from it, put what "
                                "opposes it against the body: a tool, or a mirror plane by 'symmetry'")

    def rest(self) -> Flow:
        """No flow and no contact: nothing pushes the body."""
        body = self.workpiece
        body.solution.x.array[:] = 0.0
        body.is_cold = True
        for part in body.contacts:
            part.release()
        if self.contact is not None:
            self.contact.let_go()
        still = {name: np.zeros(self.nodes.count) for name in self.gathering(self.new_history())}
        return Flow(np.zeros_like(self.x), still, 0)

    @property
    def temperature(self) -> np.ndarray | None:
        """Temperature at the nodes (nodes,) as it was given, degC, or None."""
        return self._temperature

    def temperature_in(self, history: dict[str, np.ndarray]) -> np.ndarray | None:
        """Temperature at the nodes (nodes,), degC: that of the history where it changes; or None."""
        return history.get("temperature", self._temperature)

    def powers(self) -> dict[str, float]:
        """Powers of the present flow, mW, by name."""
        w = self.workpiece
        powers = {"plastic": w.plastic_power(), "body force": w.body_force_power(), **w.mass_powers()}
        if self.contact is None:
            return powers | {"tools": 0.0, "friction": 0.0, "penalty": 0.0}
        return powers | self._contact_powers()

    def _contact_powers(self) -> dict[str, float]:
        """Powers of all contacts, mW: given by tools, friction, and what is no physics: penalty and drag."""
        velocity = self.workpiece.velocity
        powers = self.contact.powers(velocity)
        powers["penalty"] += self.workpiece.drag_power()
        between = self.interfaces.powers(velocity) if self.interfaces is not None else {}
        return powers | {name: powers[name] + power for name, power in between.items()}

    def landing_share(self) -> float:
        """Power taken by landing points and by the penalty, relative to that of the tools; 0 at rest."""
        if self.contact is None or self.workpiece.is_cold:
            return 0.0
        powers = self._contact_powers()
        return abs(powers["penalty"]) / powers["tools"] if powers["tools"] > 0 else 0.0

    def velocity_gradient(self) -> np.ndarray:
        return self.workpiece.nodal_velocity_gradient()

    def frozen(self, values: np.ndarray) -> FrozenField:
        """Nodal values (nodes, k) on the mesh as it lies now, at any place."""
        return FrozenField(self.nodes, values)

    # ------------------------------------------------------------------ mesh quality, going back
    def inverted(self) -> bool:
        """Whether a cell has lost its orientation (at its vertices or mid-nodes)."""
        return not lowest(self.nodes.comm, self.nodes.smallest_jacobian()) > 0.0

    def snapshot(self) -> tuple:
        """Everything that a failed step must give back."""
        motions = [(t.motion, t.traction, _state_of(t)) for t in self.tools]
        states = [[a.copy() for a in vars(state).values()] for state in self._states]
        w = self.workpiece
        moving = None if self.inertia is None else self.inertia.snapshot()
        return (self.x.copy(), w.solution.x.array.copy(), w.tau.copy(), w.is_cold, w.last_rate, motions, states, moving,
                self.rams.memory(), self.solved_speed)

    def continues(self, other: FlowingBody) -> None:
        """Go on as ``other`` did, whose mesh this body's replaces: speed of the tools, penalty, clocks."""
        self.speed, self.size, self.solved_speed = other.speed, other.size, other.solved_speed
        self.seconds, self.solver.seconds = other.seconds, other.solver.seconds
        self.solver.system.counts.update(other.solver.system.counts)
        if self.contact is not None:
            self.contact.reference = other.contact.reference

    def restore(self, snapshot: tuple) -> None:
        x, solution, tau, cold, last_rate, motions, states, moving, rams, self.solved_speed = snapshot
        self.rams.remember(rams)
        w = self.workpiece
        if self.inertia is not None:
            self.inertia.restore(moving)
        self.x[:] = x
        w.solution.x.array[:], w.tau[:], w.is_cold, w.last_rate = solution, tau, cold, last_rate
        for tool, (motion, traction, free) in zip(self.tools, motions, strict=True):
            tool.motion, tool.traction = motion, traction
            if tool.deformation is not None:
                tool.deformation.restore(self, free)
            elif free is not None:
                tool.free.remember(free)
        for state, arrays in zip(self._states, states, strict=True):
            for name, value in zip(vars(state), arrays, strict=True):
                setattr(state, name, value.copy())

    def follow_tools(self, time: float, ahead: float) -> float:
        """Tools that are solved at the end of a step, at ``time``, have deformed: contact knows of it, and nodes that are
        pressed are put onto those that carry them. The change of volume, mm³. Collective."""
        carried = {}
        for tool in self.tools:
            if tool.deformation is not None and tool.deformation.carries_the_surface:
                on = self._pressed_nodes().get(tool.name, np.zeros(len(self.x), bool))[self.boundary]
                carried[tool.name] = self.boundary[on & (tool.gap(self.x[self.boundary])[0] <= self.reach)]
        changed = [t.name for t in self.tools if t.deformation is not None and t.deformation.end(self, time)]
        if not changed:
            return 0.0
        self.move_tools(time)
        before = self.x.copy()
        for tool in self.tools:
            if tool.name in changed and tool.name in carried:
                every = {tool.name: np.ones(len(self.x), bool)}
                put_on_tools(self.x, [tool], carried[tool.name], every, np.inf)
        inside = np.ones(len(self.x), bool)
        inside[self.boundary] = False
        self.x[inside] += self.nodes.with_mids(self.x - before)[inside]      # mid-nodes half-way with their ends
        self.search(ahead)
        return self.free_surface.volume(self.x) - self.free_surface.volume(before) if self.free_surface else 0.0

    @property
    def _states(self) -> list:
        """The states of all contact points, of tools and of pairs of bodies."""
        between = [] if self.interfaces is None else [contact.state for contact in self.interfaces.contacts]
        return [tool.state for tool in self.tools] + between


def _state_of(tool):
    """What a tool that moves or deforms by itself must give back; None of others."""
    if tool.deformation is not None:
        return tool.deformation.snapshot()
    return None if tool.free is None else tool.free.memory()


def motion_of(drive, time: float, dim: int) -> ToolMotion:
    """Where a drive has its tool at ``time``."""
    if drive is None:
        return ToolMotion(np.zeros(dim), np.zeros(dim))
    centre = drive.rotation_centre
    axis = drive.rotation_axis
    return ToolMotion(np.asarray(drive.displacement(time), float), np.asarray(drive.velocity(time), float),
                      float(drive.angle(time)), float(drive.angular_velocity(time)),
                      None if centre is None else np.asarray(centre, float),
                      None if axis is None else np.asarray(axis, float))
