"""The stress-velocity Newton: one velocity solve on the present geometry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from time import perf_counter

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from ..errors import ConvergenceError
from .contact.rigid import STICKING, VERGE
from .line_search import LineSearch
from .linear_choice import linear_system
from .node_kernels import greatest, sums_of_squares
from .parallel import highest, total
from .point_data import sensible
from .workpiece import Workpiece


@dataclass(frozen=True)
class FlowSolution:
    """What one solve found: iterations, relative change of velocity and of contact force in the last one."""

    iterations: int
    velocity_change: float
    force_change: float


CONTINUATION = (1e-1, 1e-2)     # regularisations passed through where the direct way fails
HELD_FROM = 12                  # iterations; from then on friction keeps to the points that were closed
STUCK_FROM = 8                  # the same of warm starts along tools that stick, and to what pressed in the solve before
UNDAMPED = 4                    # iterations: so many more are then taken whole
NEXT_TO_NONE = 1e-3             # of the force that makes a body flow
UNBALANCED = 5.0                # of the force tolerance: what the forces on a body may differ by


@dataclass(frozen=True)
class _Task:
    """What one solve is given: strain and temperature at the nodes and at the points, the characteristic rate, and the
    gap below which contact is closed in the first guess."""

    nodal_strain: np.ndarray
    strain: np.ndarray
    nodal_temperature: np.ndarray | None
    temperature: np.ndarray | None
    characteristic_rate: float
    touching: float


class FlowSolver:
    """Solve the flow of a workpiece again and again as its mesh moves; matrix and symbolic factorisation are kept."""

    def __init__(self, workpiece: Workpiece):
        self.workpiece = workpiece
        self.settings = workpiece.settings
        self.seconds = {"assembly": 0.0, "linear solve": 0.0}
        self.system = linear_system(workpiece)
        self.b = fem_petsc.create_vector(workpiece.residual_form)
        self.border = _border(workpiece)
        self._search = LineSearch(workpiece) if LineSearch.fits(workpiece) else None
        self._volume: float | None = None
        self.usual_power = 0.0     # of flow at the mean flow stress and the characteristic rate, mW

    def renew_border(self) -> None:
        """Motions of tools have become unknowns, or given."""
        self.border = _border(self.workpiece)

    # ------------------------------------------------------------------ one solve
    def solve(self, *, strain: np.ndarray, characteristic_rate: float, temperature=None, touching: float = 1e-6,
              step: float | None = None) -> FlowSolution:
        """Velocity and mean stress for nodal strains (nodes,) on the present geometry.

        characteristic_rate : tool speed over body size, 1/s, which the regularisation is relative to
        temperature : (nodes,) degC or None
        step : s; ties the rates to those of the solve before (:class:`RateContinuity`), None for a single solve
        touching : gap below which a point counts as closed in the very first guess, mm

        Raises
        ------
        ConvergenceError
            if neither the warm start nor continuation in the regularisation converges.
        """
        settings, body = self.settings, self.workpiece
        task = _Task(strain, body.at_points(strain), temperature,
                     None if temperature is None else body.at_points(temperature), characteristic_rate, touching)
        history = []
        if self.border is not None:
            self.border.keep()
        if not body.is_cold:
            body.tie_to_last_rate(characteristic_rate, step)
            try:
                return self._iterate(task, settings.regularisation, stuck_from=STUCK_FROM)
            except ConvergenceError as failure:
                history.append(failure.sentence)
        body.tie_to_last_rate(characteristic_rate, None)
        goal = settings.regularisation
        slowly = tuple(r for r in CONTINUATION if r > goal) + (goal,)
        tries = [(STICKING, (goal,)), (STICKING, slowly)]
        if body.contact is not None and body.contact.sticks:
            tries += [(VERGE, (goal,)), (VERGE, slowly)]
        for bound, ladder in tries:
            try:
                return self._from_nothing(task, ladder, bound)
            except ConvergenceError as failure:
                history.append(failure.sentence)
        body.is_cold = True
        raise ConvergenceError("the flow did not converge: " + "; ".join(dict.fromkeys(history)), history=history,
                               advice="try a smaller step, a smaller solver.penalty_factor, or a larger "
                                      "solver.regularisation")

    def _from_nothing(self, task: _Task, ladder, bound: float) -> FlowSolution:
        """The flow from a linear viscous start through the regularisations of the ladder, and once more to take the
        penetration out where contact is augmented; what sticks bears ``bound`` k in shear."""
        contact, spent = self.workpiece.contact, 0
        if self.border is not None:
            self.border.start_again()
        if contact is not None:
            contact.sticking = bound
        try:
            for k, ratio in enumerate(ladder):
                found = self._iterate(task, ratio, cold=k == 0)
                spent += found.iterations
            if self.settings.augmented and contact is not None:
                found = self._iterate(task, ladder[-1])
                spent += found.iterations
        finally:
            if contact is not None:
                contact.sticking = STICKING
        return FlowSolution(spent, found.velocity_change, found.force_change)

    def _iterate(self, task: _Task, ratio: float, cold: bool = False, stuck_from: int | None = None) -> FlowSolution:
        """Newton iterations at one regularisation until velocities, forces and power no longer change; from ``stuck_from``
        on tools that stick hold what they pressed in the solve before.

        Where the body has mass, the velocity by which contact gives way counts as acceleration when it changes: there the
        multipliers are renewed within the solve, as long as they take over what the penalty still carries.
        """
        body, settings, contact = self.workpiece, self.settings, self.workpiece.contact
        self.system.follow()
        rate = self._start(task, ratio, cold)
        force = self._resultants()
        lifting, force_change, velocity_change = not self._satisfied(), 0.0, 0.0
        damping_from = settings.damping_from
        if stuck_from is not None and contact is not None and contact.sticks:
            damping_from = max(damping_from, stuck_from + UNDAMPED)
        renews, beside = settings.augmented and body.mass is not None and contact is not None, np.inf
        for iteration in range(1, settings.max_iterations + 1):
            self._assemble(lifting)
            lifting = False
            share = 0.5 if contact is not None and iteration >= damping_from and iteration % 2 == 0 else 1.0
            self._linear_solve(settle=share == 1.0 and not (cold and iteration == 1))
            if self._search is not None and self.border is None and not (cold and iteration == 1):
                share = min(share, self._search.share(self._residual_power))
            if share < 1.0:
                body.increment.x.array[:] *= share
            if self.border is not None:
                self.border.advance(share)
            rate = self._advance(task, rate, ratio, first=cold and iteration == 1)
            last, velocity_change = velocity_change, self._relative_change()
            if not np.isfinite(velocity_change):
                raise ConvergenceError(f"the velocities became infinite in iteration {iteration}")
            before, force = force, self._respond(ratio, iteration, stuck_from)
            last_change, force_change = force_change, _relative(force, before)
            # the forces of the first guess, of points that are not settled, say nothing of how fast changes shrink
            left = force_change if iteration == 2 and self.system.settles else _left(force_change, last_change)
            # where points are settled changes shrink evenly: what is left of a last one is half of it, or less
            evenly = self.system.settles and share == 1.0
            moving = min(velocity_change, 2.0 * _left(velocity_change, last)) if evenly else velocity_change
            settled = moving < settings.velocity_tolerance and left < settings.force_tolerance
            if settled and iteration > 1 + 2 * cold and self._power_imbalance() < settings.power_tolerance and \
                    self._net_force() <= UNBALANCED * settings.force_tolerance * self._size_of(force):
                before_last, beside = beside, contact.gives_way(body.mass.total_per_step()) if renews else 0.0
                if settings.force_tolerance < beside < 0.5 * before_last:
                    for part in body.contacts:
                        part.augment()
                    force = self._respond(ratio, iteration, stuck_from)
                    continue
                body.is_cold = False
                body.keep_rate(rate, task.characteristic_rate)
                return FlowSolution(iteration, velocity_change, force_change)
        raise ConvergenceError(f"after {settings.max_iterations} iterations the velocities still change by "
                               f"{velocity_change:.1e}, the contact forces by {force_change:.1e} and the power does not "
                               f"balance by {self._power_imbalance():.1e} (regularisation {ratio:.1e})")

    def _start(self, task: _Task, ratio: float, cold: bool) -> np.ndarray:
        """Point data and contact for the first iteration; the regularised rate at the points, 1/s."""
        body, contact = self.workpiece, self.workpiece.contact
        nodal = self._sigma_nodes = self._nodal_flow_stress(task, None if body.is_cold or not body.law.depends_on_rate
                                                            else body.nodal_rate())
        start = perf_counter()
        if cold:
            body.forget_flow()
            body.rate0.value = task.characteristic_rate
        else:
            body.rate0.value = ratio * task.characteristic_rate
            body.refresh_strain_rate()
        rate = body.point_rate()
        body.set_flow_stress(task.strain, rate, task.temperature)
        body.stress_from_rate(rate)
        body.cut_stress(rate)
        self.seconds["assembly"] += perf_counter() - start
        whole = body.sigma.sum()
        bad = np.isnan(body.sigma).sum() if np.isnan(whole) else 0
        if nodal is not None and np.isnan(nodal.sum()):
            bad += np.isnan(nodal).sum()
        sums = total(body.nodes.comm, np.array([whole, body.sigma.size, bad]))
        if sums[2]:
            raise ConvergenceError(f"the flow stress is not a positive, finite number at {sums[2]:.0f} points")
        flow_stress = float(sums[0] / sums[1])
        if self._volume is None:
            self._volume = body.volume()
        self.usual_power = flow_stress * task.characteristic_rate * self._volume
        self._usual_force = flow_stress * self._volume ** (1 / 2 if body.kinematics.name == "plane_strain" else 2 / 3)
        body.set_drag(self.usual_power / self._volume)
        if contact is not None:
            if contact.reference is None:
                self._set_penalty(flow_stress, task.characteristic_rate)
            contact.scale_penalty(flow_stress)
            start = perf_counter()
            for part in body.contacts:
                if cold:
                    part.rebuild_stress()
                elif self.settings.augmented:
                    part.augment()
                # gaps of a moved surface open points that press on; kept closed in the first guess, a cup takes 6 instead
                # of 15 iterations a step, a punch in space a third less. Not where motions of tools are sought in the
                # plane: there points are settled with these
                held = not cold and (body.nodes.dim == 3 or self.border is None)
                part.respond(body.velocity, flow_stress=self._sigma_nodes, touching=task.touching if cold else None,
                             slip0=contact.slip0 / contact.slip_regularisation if cold else None, held=held)
            self.seconds["assembly"] += perf_counter() - start
        return rate

    def _advance(self, task: _Task, rate: np.ndarray, ratio: float, first: bool) -> np.ndarray:
        """Velocity, stress and flow stress after the increment; the regularised rate at the points, 1/s."""
        body = self.workpiece
        start = perf_counter()          # the integrands at the points, by compiled kernels: part of the assembly
        body.update_stress(rate, body.rate_of_increment())
        body.solution.x.array[:] += body.increment.x.array
        if first:
            # the linear viscous start is found; its stress would be a poor guess, so one Picard step follows
            body.rate0.value = ratio * task.characteristic_rate
            body.tau[:] = 0.0
        rate = body.point_rate()
        if body.law.depends_on_rate or body.continuity is not None or first:
            body.set_flow_stress(task.strain, rate, task.temperature)
        if body.law.depends_on_rate and self._sigma_nodes is not None:
            self._sigma_nodes = self._nodal_flow_stress(task, body.nodal_rate())
        body.cut_stress(rate)
        self.seconds["assembly"] += perf_counter() - start
        return rate

    def _respond(self, ratio: float, iteration: int, stuck_from: int | None) -> np.ndarray:
        """Contact tractions at the present velocities; the resultant forces, (tools and pairs of bodies, k)."""
        body, settings = self.workpiece, self.settings
        grip = "new" if iteration == HELD_FROM or iteration == 1 and self.border is not None else \
            "follows" if iteration < HELD_FROM else "held"
        stuck = grip
        if stuck_from is not None and iteration >= stuck_from:
            stuck = "before" if iteration == stuck_from else "held"
        start = perf_counter()          # the integrands of contact at its points, as those of the body: assembly
        for part in body.contacts:
            of_part = {"grip": grip, "stuck": stuck} if part is body.contact else {"grip": grip}
            part.respond(body.velocity, flow_stress=self._sigma_nodes, **of_part,
                         slip0=body.contact.slip0 * ratio / settings.regularisation)
        self.seconds["assembly"] += perf_counter() - start
        return self._resultants()

    def _resultants(self) -> np.ndarray:
        contacts = self.workpiece.contacts
        return np.concatenate([part.resultants() for part in contacts]) if contacts else np.zeros((1, 1))

    # ------------------------------------------------------------------ parts of an iteration
    def _nodal_flow_stress(self, task: _Task, rate: np.ndarray | None) -> np.ndarray | None:
        """Flow stress at the nodes, which limits friction; None where there is none. Without a rate: the usual one."""
        body = self.workpiece
        if not any(part.needs_flow_stress for part in body.contacts):
            return None
        usual = task.characteristic_rate
        rate = np.full(body.nodes.count, usual) if rate is None else np.maximum(rate, self.settings.regularisation * usual)
        return sensible(np.broadcast_to(body.nodal_law(task.nodal_strain, rate, task.nodal_temperature), rate.shape))

    def _set_penalty(self, flow_stress: float, rate: float):
        body, contact = self.workpiece, self.workpiece.contact
        for part in body.contacts:
            part.silence()
        with body.newtonian(rate):
            self._assemble(lifting=False, matrix_only=True)
        contact.set_penalty(self.system.stiffness().mean(axis=1), body.nodal_areas(), self.settings.penalty_factor,
                            flow_stress)

    def _assemble(self, lifting: bool, matrix_only: bool = False):
        start = perf_counter()
        body = self.workpiece
        self.system.assemble()
        if not matrix_only:
            self._assemble_residual()
            if lifting:
                self.system.lift(self.b)
            self.b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            owned = body.fixed_dofs[body.fixed_dofs < body.owned]
            self.b.array[owned] = body.solution.x.array[owned] - body._values.x.array[owned]
            self.b.scale(-1.0)
        self.seconds["assembly"] += perf_counter() - start

    def _assemble_residual(self):
        body = self.workpiece
        with self.b.localForm() as local:
            local.set(0.0)
        fem_petsc.assemble_vector(self.b, body.residual_form)
        if body.interfaces is not None:
            body.interfaces.add_forces(self.b)

    def _power_imbalance(self) -> float:
        """Power that the residual does on the present velocities, relative to the plastic power."""
        start = perf_counter()
        body = self.workpiece
        power = abs(self._residual_power(body.solution.x.petsc_vec))
        if self.border is not None:
            power += self.border.power()
        # a body that is only pushed along has no plastic power; then a fraction of what flowing would take is the scale
        scale = body.plastic_power() + 1e-3 * self.usual_power
        self.seconds["assembly"] += perf_counter() - start
        return power / scale

    def _residual_power(self, velocity: PETSc.Vec) -> float:
        """Power that the residual of the present velocities, put into ``b``, does on others, mW. Collective."""
        body = self.workpiece
        self._assemble_residual()
        self.b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        owned = body.fixed_dofs[body.fixed_dofs < body.owned]
        self.b.array[owned] = 0.0
        return self.b.dot(velocity)

    def _size_of(self, force: np.ndarray) -> float:
        """The greatest of the forces, N; where nothing opposes the body, a thousandth of what makes it flow."""
        return max(float(np.abs(force).max()), NEXT_TO_NONE * self._usual_force)

    def _net_force(self) -> float:
        """Greatest force on the whole body, N, that the residual of :meth:`_power_imbalance` leaves: along directions in
        which nothing holds it. A point that rests on a tool has next to no power, whatever force it feels. None where
        inertia acts, whose momentum has a ledger of its own. Collective."""
        body = self.workpiece
        if body.mass is not None and body.mass.properties.inertia:
            return 0.0
        held = {condition.component for condition in body.fixed} | set(range(body.kinematics.name == "axisymmetric"))
        sums = [self.b.array[own[own < body.owned]].sum() for k, own in enumerate(body.velocity_dofs.T) if k not in held]
        return float(np.abs(total(body.nodes.comm, np.array(sums))).max()) if sums else 0.0

    def _linear_solve(self, settle: bool):
        start = perf_counter()
        solve = self.system.solve if self.border is None else partial(self.border.solve, self.system)
        solve(self.b)
        if settle:
            self.system.settle(self.b, solve, self.border)
        self.seconds["linear solve"] += perf_counter() - start

    def _satisfied(self) -> bool:
        """Whether the fixed velocities have their values; collective, also for a rank that has none."""
        body = self.workpiece
        error = np.abs(body.solution.x.array[body.fixed_dofs] - body._values.x.array[body.fixed_dofs])
        worst = float(error.max()) if error.size else 0.0
        return (highest(body.nodes.comm, worst)) == 0.0

    def _relative_change(self) -> float:
        body = self.workpiece
        squares = sums_of_squares(body.increment.x.array, body.solution.x.array, body.owned_velocity_dofs)
        sums = total(body.nodes.comm, squares)
        return float(np.sqrt(sums[0] / sums[1])) if sums[1] > 0 else 0.0


def _border(workpiece: Workpiece):
    """The unknown motions of its tools in the system of a workpiece; None where all motions are given."""
    if workpiece.contact is None or not any(tool.is_sought for tool in workpiece.contact.tools):
        return None
    from .bordering import AppendedBorder, Border
    many = any(tool.is_sought and tool.free.deforms for tool in workpiece.contact.tools)
    return AppendedBorder(workpiece) if many else Border(workpiece)


def _relative(force: np.ndarray, before: np.ndarray) -> float:
    """Greatest change of the forces relative to the greatest force; 0 where there is none."""
    size, change = greatest(force, before)
    return change / size if size > 0 else 0.0


def _left(change: float, before: float) -> float:
    """What is still to come where changes shrink like a geometric series; the last change where they do not."""
    return change * min(1.0, change / (before - change)) if change < before else change
