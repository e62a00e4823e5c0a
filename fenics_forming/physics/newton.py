"""The stress-velocity Newton: one velocity solve on the present geometry."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from ..errors import ConvergenceError
from .linear import DirectSolver
from .parallel import highest, total
from .workpiece import Workpiece


@dataclass(frozen=True)
class FlowSolution:
    """What one solve found: iterations, relative change of velocity and of contact force in the last one."""

    iterations: int
    velocity_change: float
    force_change: float


class FlowSolver:
    """Solve the flow of a workpiece again and again as its mesh moves; matrix and symbolic factorisation are kept."""

    def __init__(self, workpiece: Workpiece):
        self.workpiece = workpiece
        self.settings = workpiece.settings
        self.seconds = {"assembly": 0.0, "linear solve": 0.0}
        self.A = fem_petsc.create_matrix(workpiece.tangent_form)
        self.b = fem_petsc.create_vector(workpiece.residual_form)
        self._linear: DirectSolver | None = None
        self._volume: float | None = None
        self.usual_power = 0.0     # of flow at the mean flow stress and the characteristic rate, mW

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
        ratio = self.settings.regularisation
        history = []
        self.workpiece.tie_to_last_rate(characteristic_rate, None if self.workpiece.is_cold else step)
        if not self.workpiece.is_cold:
            try:
                return self._iterate(strain, temperature, characteristic_rate, ratio, ratio, None)
            except ConvergenceError as failure:
                history.append(str(failure))
        self.workpiece.tie_to_last_rate(characteristic_rate, None)
        for ladder in ((ratio,), tuple(r for r in (1e-1, 1e-2) if r > ratio) + (ratio,)):
            try:
                spent = 0
                for k, r in enumerate(ladder):
                    found = self._iterate(strain, temperature, characteristic_rate, r, r,
                                          touching if k == 0 else None)
                    spent += found.iterations
                if self.settings.augmented and self.workpiece.contact is not None:
                    found = self._iterate(strain, temperature, characteristic_rate, ratio, ratio, None)
                    spent += found.iterations
                return FlowSolution(spent, found.velocity_change, found.force_change)
            except ConvergenceError as failure:
                history.append(str(failure))
        self.workpiece.is_cold = True
        raise ConvergenceError("the flow did not converge: " + "; ".join(dict.fromkeys(history)), history=history,
                               advice="try a smaller step, a smaller solver.penalty_factor, or a larger "
                                      "solver.regularisation")

    def _iterate(self, strain, temperature, characteristic_rate, ratio, slip_ratio, touching) -> FlowSolution:
        body, s, contact = self.workpiece, self.settings, self.workpiece.contact
        cold = touching is not None
        points = body.at_points(strain)
        heat = None if temperature is None else body.at_points(temperature)
        sigma_nodes = self._nodal_flow_stress(strain, temperature, characteristic_rate)
        slip0 = None
        if cold:
            body.solution.x.array[:] = 0.0
            body.strain_rate[:] = 0.0
            body.tau[:] = 0.0
            body.rate0.value = characteristic_rate
            slip0 = contact.slip0 / contact.slip_regularisation if contact is not None else None
            if contact is not None:
                contact.rebuild_stress()
        else:
            body.rate0.value = ratio * characteristic_rate
            body.refresh_strain_rate()
        rate = body.point_rate()
        body.set_flow_stress(points, rate, heat)
        body.cut_stress(rate)
        if self._volume is None:
            self._volume = body.volume()
        mean = total(body.nodes.comm, np.array([body.sigma.sum(), body.sigma.size]))
        mean = float(mean[0] / mean[1])
        self.usual_power = mean * characteristic_rate * self._volume
        if contact is not None:
            if contact.reference is None:
                self._set_penalty(mean)
            contact.scale_penalty(mean)
            if s.augmented and not cold:
                contact.augment()
            contact.respond(body.velocity, flow_stress=sigma_nodes, touching=touching, slip0=slip0)
            force = contact.resultants()
        velocity_change = force_change = np.inf
        free = self._satisfied()
        for iteration in range(1, s.max_iterations + 1):
            self._assemble(lifting=not free)
            free = True
            self._linear_solve()
            increment = body.increment.x.array
            if contact is not None and iteration >= s.damping_from and iteration % 2 == 0:
                increment *= 0.5
            increment_rate = body.rate_of_increment()
            body.update_stress(rate, increment_rate)
            body.solution.x.array[:] += increment
            if cold and iteration == 1:
                # the linear viscous start is found; its stress would be a poor guess, so one Picard step follows
                body.rate0.value = ratio * characteristic_rate
                body.tau[:] = 0.0
            rate = body.point_rate()
            if body.law.depends_on_rate or body.continuity is not None or (cold and iteration == 1):
                body.set_flow_stress(points, rate, heat)
                if contact is not None and contact.needs_flow_stress and body.law.depends_on_rate:
                    sigma_nodes = self._nodal_flow_stress(strain, temperature, characteristic_rate, body.nodal_rate())
            body.cut_stress(rate)
            velocity_change = self._relative_change()
            if not np.isfinite(velocity_change):
                raise ConvergenceError(f"the velocities became infinite in iteration {iteration}")
            if contact is not None:
                old = force
                contact.respond(body.velocity, flow_stress=sigma_nodes, relaxation=1.0 if iteration < 5 else 0.5 if iteration < 12 else 0.25,
                                slip0=None if slip_ratio == s.regularisation else
                                contact.slip0 * slip_ratio / s.regularisation)
                force = contact.resultants()
                size = np.abs(force).max()
                force_change = np.abs(force - old).max() / size if size > 0 else 0.0
            else:
                force_change = 0.0
            if velocity_change < s.velocity_tolerance and force_change < s.force_tolerance \
                    and iteration > 1 + 2 * cold and self._power_imbalance() < s.power_tolerance:
                body.is_cold = False
                body.keep_rate(rate, characteristic_rate)
                return FlowSolution(iteration, velocity_change, force_change)
        raise ConvergenceError(f"after {s.max_iterations} iterations the velocities still change by {velocity_change:.1e} "
                               f"and the contact forces by {force_change:.1e} (regularisation {ratio:.1e})")

    # ------------------------------------------------------------------ parts of an iteration
    def _nodal_flow_stress(self, strain, temperature, characteristic_rate, nodal_rate=None):
        body = self.workpiece
        if body.contact is None or not body.contact.needs_flow_stress:
            return None
        floor = self.settings.regularisation * characteristic_rate
        if nodal_rate is None:
            nodal_rate = np.full(len(strain), characteristic_rate) if body.is_cold or not body.law.depends_on_rate \
                else body.nodal_rate()
        return np.broadcast_to(body.law(strain, np.maximum(nodal_rate, floor), temperature), strain.shape)

    def _set_penalty(self, flow_stress: float):
        body, contact = self.workpiece, self.workpiece.contact
        contact.silence()
        self._assemble(lifting=False, matrix_only=True)
        diagonal = self.A.getDiagonal()
        body.increment.x.petsc_vec.setArray(diagonal.array)
        body.increment.x.scatter_forward()
        stiffness = body.increment.x.array[body.velocity_dofs]
        contact.set_penalty(stiffness.mean(axis=1), body.nodal_areas(), self.settings.penalty_factor,
                            flow_stress)

    def _assemble(self, lifting: bool, matrix_only: bool = False):
        start = perf_counter()
        body = self.workpiece
        self.A.zeroEntries()
        fem_petsc.assemble_matrix(self.A, body.tangent_form, bcs=body.conditions)
        self.A.assemble()
        if not matrix_only:
            self._assemble_residual()
            if lifting:
                fem_petsc.apply_lifting(self.b, [body.tangent_form], [body.conditions], x0=[body.solution.x.petsc_vec],
                                        alpha=-1.0)
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

    def _power_imbalance(self) -> float:
        """Power that the residual does on the present velocities, relative to the plastic power."""
        start = perf_counter()
        body = self.workpiece
        self._assemble_residual()
        self.b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        owned = body.fixed_dofs[body.fixed_dofs < body.owned]
        self.b.array[owned] = 0.0
        power = self.b.dot(body.solution.x.petsc_vec)
        # a body that is only pushed along has no plastic power; then a fraction of what flowing would take is the scale
        scale = body.plastic_power() + 1e-3 * self.usual_power
        self.seconds["assembly"] += perf_counter() - start
        return abs(power) / scale

    def _linear_solve(self):
        start = perf_counter()
        if self._linear is None:
            self._linear = DirectSolver(self.A)
        self._linear.factorise()
        self._linear.solve(self.b, self.workpiece.increment.x.petsc_vec)
        self.workpiece.increment.x.scatter_forward()
        self.seconds["linear solve"] += perf_counter() - start

    def _satisfied(self) -> bool:
        """Whether the fixed velocities have their values; collective, also for a rank that has none."""
        body = self.workpiece
        error = np.abs(body.solution.x.array[body.fixed_dofs] - body._values.x.array[body.fixed_dofs])
        worst = float(error.max()) if error.size else 0.0
        return (highest(body.nodes.comm, worst)) == 0.0

    def _relative_change(self) -> float:
        body = self.workpiece
        d = body.increment.x.array[body.owned_velocity_dofs]
        v = body.solution.x.array[body.owned_velocity_dofs]
        sums = total(body.nodes.comm, np.array([d @ d, v @ v]))
        return float(np.sqrt(sums[0] / sums[1])) if sums[1] > 0 else 0.0
