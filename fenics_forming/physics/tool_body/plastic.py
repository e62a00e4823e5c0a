r"""The elastic-plastic tool: Newton's iteration with the consistent tangent, load steps that are cut where it fails.

What the material answers is in ``bulk``.  The first increment of a step uses the elastic factorisation, which is there
already: it is right when the tool unloads, and the tangent that follows is that of points which flow in this step.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from ...errors import ConvergenceError
from ..linear import DirectSolver
from .body import ToolBody
from .bulk import ElasticBulk, PlasticBulk, PlasticState
from .compliance import compliance
from .elastic import ElasticFactor, set_held_rows

RUNAWAY = 1e6      # an imbalance as many times the usual forces comes from displacements that only grow


@dataclass(frozen=True)
class ToolSettings:
    """Numerical parameters of an elastic-plastic solve.

    Attributes
    ----------
    steps : load steps in which loads are brought on, where the tool yields at all
    tolerance : norm of the nodal forces that do not balance, relative to the largest forces of the history
    max_iterations : a step that needs more is cut
    smallest_step : part of the load below which steps are no longer cut: the tool cannot carry more
    """

    steps: int = 10
    tolerance: float = 1e-9
    max_iterations: int = 20
    smallest_step: float = 1e-3


class PlasticSolver:
    """Solve an elastic-plastic tool for one set of loads after the other; its state is that of the last accepted step.

    Attributes
    ----------
    plastic : `PlasticState` · force : nodal forces of the loads that are carried now
    reached : part of the way from the loads before to those of the last solve · cuts : of load steps, since the start
    external_work, plastic_work, thermal_work : mJ, since the start; the last that of the stresses on the thermal strains
    """

    def __init__(self, body: ToolBody, settings: ToolSettings = ToolSettings()):
        self.body, self.settings, self.factor = body, settings, ElasticFactor(body)
        self.seconds = {"elastic solve": 0.0, "points": 0.0, "assembly": 0.0, "tangent solve": 0.0}
        self.bulk = self._bulk()
        self._matrix: PETSc.Mat | None = None
        self._direct: DirectSolver | None = None
        self._increment = fem.Function(body.space)
        self.force = body.new_vector()
        self.external_work = self.plastic_work = self.thermal_work = 0.0
        self.reached, self._held, self._largest_force, self.cuts = 1.0, 0.0, 0.0, 0
        self._forces = self.force.copy()
        self._balanced = self._forces           # internal forces of the accepted state
        self._accepted = body.displacement.x.array.copy()
        self._accepted_heat: np.ndarray | None = None

    def _bulk(self) -> PlasticBulk | ElasticBulk:
        return PlasticBulk(self.body)

    @property
    def plastic(self) -> PlasticState | None:
        """The accepted state at the points; None of a body that cannot yield."""
        return self.bulk.plastic

    # ------------------------------------------------------------------ loading
    def solve(self, loads=(), *, held: float = 1.0, steps: int | None = None) -> int:
        """Go from the present loads to these, in one step where the tool stays elastic; the number of iterations.

        Parameters
        ----------
        held : the part of their values that the held displacements go to · steps : see `ToolSettings`

        Raises
        ------
        ConvergenceError
            where no further load can be brought on; the tool is left with what it carries (``reached``).
        """
        start, target = self.force.copy(), self.body.external_forces(loads)
        if self._step_elastically(target, held):
            self._accept(target)
            self.reached = 1.0
            return 1
        held_start, self.reached, spent, history = self._held, 0.0, 0, []
        size = whole = 1.0 / (self.settings.steps if steps is None else steps)
        while self.reached < 1.0:
            part = self.reached + size
            part = 1.0 if part > 1 - 1e-9 else part
            wanted = _between(start, target, part)
            try:
                spent += self._equilibrate(wanted, held_start + part * (held - held_start),
                                           (part - self.reached) / (1.0 - self.reached))
            except ConvergenceError as failure:
                history.append(failure.sentence)
                self._take_back()
                self.cuts += 1
                size *= 0.5
                if size < self.settings.smallest_step:
                    raise self._collapse(history) from failure
            else:
                self._accept(wanted)
                self.reached, size = part, min(whole, 2 * size)
        return spent

    def _collapse(self, history) -> ConvergenceError:
        return ConvergenceError(f"the tool carries {100 * self.reached:.1f} % of the step to its new loads, no more",
                                history=history, advice=self._advice())

    @property
    def _most_iterations(self) -> int:
        return self.settings.max_iterations

    def _advice(self) -> str:
        return "it yields as a whole: try smaller loads, hardening, or a higher yield stress"

    def _step_elastically(self, target: PETSc.Vec, held: float) -> bool:
        """The whole step with the elastic stiffness; whether no point flows in it, else everything is as before."""
        self.body.set_held(held)
        self._heat(1.0)
        self._elastic_increment(target)
        flowing = self._respond()
        if not flowing and self._imbalance(target) <= self.settings.tolerance * self._usual_force(target):
            return True
        self._take_back()
        return False

    # ------------------------------------------------------------------ one step
    def _equilibrate(self, target: PETSc.Vec, held: float, heat: float) -> int:
        """Newton iterations to the balance of the given nodal forces; their number.

        held : part of the given displacements · heat : part of what is left of the way to the given temperature
        """
        self.body.set_held(held)
        self._heat(heat)
        self._elastic_increment(target)
        return self._iterate(target)

    def _iterate(self, target: PETSc.Vec) -> int:
        """Newton iterations from the present displacement; their number."""
        usual = 0.0
        for iteration in range(1, self._most_iterations + 1):
            flowing = self._respond()
            imbalance = self._imbalance(target)
            if iteration == 1:
                usual = self._usual_force(target)
            if not imbalance < RUNAWAY * usual:     # not a number, too
                raise ConvergenceError(f"the displacements ran away in iteration {iteration}")
            if imbalance <= self.settings.tolerance * usual:
                return iteration
            if flowing:
                self._tangent_increment()
            else:
                self._elastic_increment(target)
        raise ConvergenceError(f"after {self._most_iterations} iterations the forces do not balance by "
                               f"{imbalance / usual:.1e}")

    def _heat(self, part: float) -> None:
        """Go a part of the way to the wanted thermal strain; the forces are those of the stress that it leaves."""
        heating = self.body.heating
        if heating is not None:
            self.bulk.heats()
            change = part * (heating.wanted - self._thermal)
            heating.strain = self._thermal + change
            self._forces = self._forces.copy()
            self._forces.axpy(-1.0, heating.forces(change))

    @property
    def _thermal(self) -> np.ndarray:
        """Thermal strain of the accepted state, (p,)."""
        return np.zeros(len(self.body.volumes)) if self._accepted_heat is None else self._accepted_heat

    def _elastic_increment(self, target: PETSc.Vec) -> None:
        start = perf_counter()
        load = target.copy()
        load.axpy(-1.0, self._forces)
        self._driving = self.factor.solve(load, self._increment, since=self.body.displacement)
        self.body.displacement.x.array[:] += self._increment.x.array
        self.seconds["elastic solve"] += perf_counter() - start

    def _tangent_increment(self) -> None:
        self._factorise_tangent()
        start = perf_counter()
        self._direct.solve(self._out_of_balance, self._increment.x.petsc_vec)
        self._increment.x.scatter_forward()
        self.body.displacement.x.array[:] += self._increment.x.array
        self.seconds["tangent solve"] += perf_counter() - start

    def _factorise_tangent(self) -> None:
        """The consistent tangent of the last response at the points, factorised."""
        start = perf_counter()
        self._matrix = self.bulk.tangent(self._matrix)
        assembled = perf_counter()
        if self._direct is None:
            self._direct = DirectSolver(self._matrix)
        self._direct.factorise()
        self.seconds["assembly"] += assembled - start
        self.seconds["tangent solve"] += perf_counter() - assembled

    def _respond(self) -> bool:
        """Forces for the present displacement; whether any point flows. Collective."""
        start = perf_counter()
        flowing = self.bulk.respond()
        self._forces = self.internal_forces()
        self.seconds["points"] += perf_counter() - start
        return flowing

    def _imbalance(self, target: PETSc.Vec) -> float:
        """Norm of the forces that do not balance, N."""
        self._out_of_balance = target.copy()
        self._out_of_balance.axpy(-1.0, self._forces)
        set_held_rows(self.body, self._out_of_balance, self.body.displacement)
        return self._out_of_balance.norm()

    def _usual_force(self, target: PETSc.Vec) -> float:
        """What an imbalance is small against: the largest forces of the history and of the start of this step, N; also what
        drives the step where no forces come of it, as in free expansion.

        Not those of later iterations: where a tool collapses they grow without bound, and would excuse any imbalance.
        """
        return max(self._largest_force, target.norm(), self._forces.norm(), self._driving)

    # ------------------------------------------------------------------ accepting
    def _accept(self, force: PETSc.Vec) -> None:
        """The trial state becomes the state."""
        body = self.body
        heated = None if body.heating is None else body.heating.strain - self._thermal
        plastic, thermal = self.bulk.accept(heated)
        self.plastic_work += plastic
        self.thermal_work += thermal
        self.external_work += self._work_done(force)
        self._accepted_heat = None if body.heating is None else body.heating.strain
        self.force, self._balanced, self._held = force, self._forces, body.held_part
        self._accepted = body.displacement.x.array.copy()
        self._largest_force = self._usual_force(force)

    def _work_done(self, force: PETSc.Vec) -> float:
        """Work of loads and of moved supports in the step, mJ."""
        body = self.body
        moved = body.displacement.x.petsc_vec.copy()
        moved.array[:] -= self._accepted[: body.owned]
        acting = []
        for load, inside in ((self.force, self._balanced), (force, self._forces)):
            both = load.copy()
            own = body.fixed_dofs[body.fixed_dofs < body.owned]
            both.array[own] = inside.array_r[own]      # load and reaction together
            acting.append(both)
        acting[0].axpy(1.0, acting[1])
        return 0.5 * acting[0].dot(moved)

    def state(self) -> tuple:
        """The accepted state, for :meth:`go_back`: nothing in it is changed any more."""
        kept = {name: value for name, value in vars(self).items() if name in _STATE}
        return kept, self.bulk.state(), self.body.held_part

    def go_back(self, state: tuple) -> None:
        """Take over what :meth:`state` gave."""
        vars(self).update(state[0])
        self.bulk.go_back(state[1])
        self.body.set_held(state[2])
        self._take_back()

    def _take_back(self) -> None:
        """Back to the accepted state."""
        self.body.displacement.x.array[:] = self._accepted
        if self.body.heating is not None:
            self.body.heating.strain = self._thermal
        self.bulk.take_back()
        self._forces = self.internal_forces()

    # ------------------------------------------------------------------ what others ask
    def compliance(self, dofs: np.ndarray) -> np.ndarray:
        """See `compliance.compliance`: by the consistent tangent of the last step, the elastic one if no point flowed in
        it. Collective."""
        if self.bulk.flows:
            self.bulk.use_accepted_tangent()
            self._factorise_tangent()
            return compliance(self.body, self._direct, dofs)
        return compliance(self.body, self.factor.direct, dofs)

    def point_stress(self) -> np.ndarray:
        """Stresses at the points, (p, c), MPa."""
        return self.bulk.point_stress()

    def internal_forces(self) -> PETSc.Vec:
        """Nodal forces that the stresses and springs hold in balance, N."""
        return self.bulk.forces()


_STATE = ("force", "external_work", "plastic_work", "thermal_work", "reached", "cuts", "_held", "_largest_force",
          "_balanced", "_accepted", "_accepted_heat")


def _between(start: PETSc.Vec, end: PETSc.Vec, part: float) -> PETSc.Vec:
    """The forces a part of the way from one vector to another."""
    between = start.copy()
    between.scale(1.0 - part)
    between.axpy(part, end)
    return between
