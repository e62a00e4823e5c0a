"""A flowing body between its tools at a given time: what the time schemes act on."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..errors import ConvergenceError
from ..physics.contact.rigid import RigidContact
from ..physics.newton import FlowSolver
from ..physics.node_kernels import moments
from ..physics.parallel import highest, lowest, total
from ..physics.workpiece import Workpiece
from .approach import NEAR
from .body_powers import BodyPowers
from .body_volume import BodyVolume
from .frozen import FrozenField
from .going_back import GoingBack
from .integration import Flow
from .moving import follow_weight
from .tool_side import ToolSide
from .tools.machines import Rams
from .touching import Touching
from .volume import FreeSurface

HOVER = 2e-4   # of the size of a contact facet: a pressed node that hovers less than this above its tool is on it


# How far a solve is implicit in hardening and change of shape (physics.rate_continuity). Without it the flow of a
# smooth, perfectly plastic block in plane strain is left to chance (bands, 1 to 5 % of the force); with these values it is
# the uniform one from 20 to 200 steps, and the sticking billet changes by 0.3 % at 60 %.
TIE = 0.75          # share of the step
LEAST_TIE = 0.03    # and at least over this strain increment


class FlowingBody(ToolSide, Touching, BodyVolume, BodyPowers, GoingBack):
    """Workpiece, solver, tools and drives together; implements ``integration.Body``.

    Parameters
    ----------
    workpiece : terms and spaces (its ``contact`` may be None)
    drives : tool name → drive of ``laws.equipment``; tools that are not named rest
    boundary : (n,) nodes that a tool may touch
    working_direction : (dim,), the unit vector along which the main tool moves; the extent on it makes the characteristic
        rate
    temperature : degC, or None; of several bodies (nodes,)
    damage : law of ``laws.damage``, or None: no damage gathers
    free_surface : of the same nodes, to measure and restore the volume by
    surfaces : the same by name, where there are several bodies
    initial_velocity : (nodes, dim) mm/s at the start; given where inertia acts, and only there
    heat : ``heating.BodyHeat``, where temperatures change, or None; then they are part of the history
    """

    def __init__(self, workpiece: Workpiece, *, drives: dict, boundary: np.ndarray, working_direction: np.ndarray,
                 temperature: float | np.ndarray | None = None, damage=None, free_surface: FreeSurface | None = None,
                 surfaces: dict[str, FreeSurface] | None = None, initial_velocity: np.ndarray | None = None,
                 heat=None):
        self.workpiece, self.nodes = workpiece, workpiece.nodes
        self.solver = FlowSolver(workpiece)
        self.contact: RigidContact | None = workpiece.contact
        self.tools = self.contact.tools if self.contact is not None else []
        self._drives, self.boundary, self.working_direction = drives, boundary, np.asarray(working_direction, float)
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

    # ------------------------------------------------------------------ flow
    def height(self) -> float:
        """Extent of the body along the working direction, mm."""
        return self._extent(self.x @ self.working_direction)

    def _extent(self, along: np.ndarray) -> float:
        """Of the body on a line, from the places of its nodes along it (nodes,), mm. Collective."""
        comm = self.nodes.comm
        return highest(comm, float(along.max(initial=-np.inf))) - lowest(comm, float(along.min(initial=np.inf)))

    def time_to_height(self, wanted: float, velocity: np.ndarray, horizon: float) -> float:
        """Time in which the nodal velocities (nodes, dim) bring the height to ``wanted``, s; at most ``horizon``."""
        now, time = self.height(), horizon
        for _ in range(3):      # secants: the height is convex in time
            then = self._extent((self.x + time * velocity) @ self.working_direction)
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
            raise ConvergenceError("a cell of the mesh is inverted", advice="the mesh is too distorted: try a new mesh in "
                                   "time (remesh = true of the workpiece; where it is on, finer elements: tools may have "
                                   "come nearer to each other than an element), smaller steps, or stop earlier")
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
            self._follow_speed(self.speed if self.tool_speed() >= self.speed else 0.0)      # or the body leads
        else:
            if self.workpiece.mass is not None:
                follow_weight(self)
            tied = max(TIE * dt, LEAST_TIE / max(characteristic_rate, self._mean_rate(characteristic_rate)))
            self._follow_speed(self.speed)
        solve = partial(self.solver.solve, strain=history["effective_strain"], characteristic_rate=characteristic_rate,
                        step=tied, temperature=self.temperature_in(history), touching=NEAR * self.size)
        border = self.solver.border
        rise = partial(self._rise, history)
        once = lambda: (solve() if border is None else border.solved(solve, rise)).iterations  # noqa: E731
        try:
            iterations = once()
            if self.deformations and ahead == 1.0:       # only those that take the tools along
                from .tools.deformation import agree
                iterations += agree(self, once)
        except ConvergenceError as failure:
            from .explaining import explained
            raise explained(self, failure) from failure
        if border is not None and self.solved_speed > 0:
            self.solved_speed = self.tool_speed()       # as fast as the solve has found them to be
        if self.inertia is not None:
            self.inertia.found(self, time, halfway=gaps is not None)
        return Flow(self.workpiece.velocity, self.rates(history), iterations)

    def _rise(self, history: dict[str, np.ndarray]) -> float:
        """Rise of the force of forming with the way of the tools, relative to it, 1/mm: by the change of shape, and by
        hardening, both in proportion to the strain. Collective."""
        strain, law, rate = history["effective_strain"], self.workpiece.nodal_law, self.workpiece.nodal_rate()
        now, then = (np.broadcast_to(law(e, rate, self.temperature_in(history)), strain.shape)
                     for e in (strain, strain + 0.01))
        sums = total(self.nodes.comm, np.array([now.sum(), then.sum()]))
        hardening = max(float(sums[1] / sums[0] - 1.0) / 0.01, 0.0)
        return (1.0 + hardening) * max(self._mean_rate(self.speed / self.height()) / self.speed, 1.0 / self.height())

    def _follow_speed(self, speed: float) -> None:
        """Let the flow of the solve before start the next one faster or slower, as the tools have become: on a crank, whose
        speed changes in every step, that is 4 instead of 20 iterations. ``speed`` of the tools that make it flow, mm/s."""
        if not self.workpiece.is_cold and self.solved_speed > 0 and speed not in (0.0, self.solved_speed):
            self.workpiece.solution.x.array[self.workpiece.velocity_dofs] *= speed / self.solved_speed
            for tool in self.tools:
                if tool.is_sought:
                    tool.free.follow(speed / self.solved_speed)
        self.solved_speed = speed

    def _mean_rate(self, characteristic_rate: float) -> float:
        """Effective strain rate of the solve before, 1/s, where the body flows: its mean weighted by itself.

        Of a body that flows as a whole it is about the characteristic rate; in an extrusion, where only a small part
        flows at a time, it is much higher. Collective.
        """
        if self.workpiece.last_rate is None:
            return 0.0
        rate, before = self.workpiece.last_rate
        sums = total(self.nodes.comm, moments(rate, self.nodes.cell_sizes()))
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

    def velocity_gradient(self) -> np.ndarray:
        return self.workpiece.nodal_velocity_gradient()

    def turn(self, before: np.ndarray) -> None:
        """The nodes have gone on from ``before`` (nodes, dim): what the next solve starts from turns along."""
        from .turning import turn
        turn(self, before)

    def frozen(self, values: np.ndarray) -> FrozenField:
        """Nodal values (nodes, k) on the mesh as it lies now, at any place."""
        return FrozenField(self.nodes, values)

    # ------------------------------------------------------------------ mesh quality, going back
    def inverted(self) -> bool:
        """Whether a cell has lost its orientation (at its vertices or mid-nodes)."""
        return not lowest(self.nodes.comm, self.nodes.smallest_jacobian()) > 0.0
