"""The state at the integration points of a body: strain rate, flow stress, and the stress of the linearisation."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np

from .point_kernels import advance, cut, regularised
from .rate_continuity import RateContinuity


def sensible(stress: np.ndarray) -> np.ndarray:
    """A flow stress with NaN for what is none. The solve then fails on every rank, whichever of them has the point."""
    if stress.size == 0 or (stress.min() > 0.0 and stress.max() < np.inf):
        return stress
    return np.where((stress > 0.0) & (stress < np.inf), stress, np.nan)


class PointData:
    """The point data of a `Workpiece`; mixed into it."""

    def at_points(self, nodal: np.ndarray) -> np.ndarray:
        """A nodal field at the integration points of the cells, (cells * points,)."""
        return (nodal[self.nodes.vertices] @ self._hats.T).ravel()

    def point_rate(self) -> np.ndarray:
        """Regularised effective strain rate at the integration points, 1/s."""
        return regularised(self.strain_rate, float(self.rate0.value))

    def set_flow_stress(self, strain, rate, temperature) -> None:
        """Flow stress and its rate sensitivity at the integration points."""
        if self.law.depends_on_rate or strain is not self._hardened_at:
            self._hardened = sensible(np.broadcast_to(self.law(strain, rate, temperature), rate.shape))
            self._hardened_at = strain
        sigma, c = self._hardened.copy(), np.ones(len(rate))
        if self.law.depends_on_rate:
            c -= rate * self.law.rate_derivative(strain, rate, temperature) / sigma
        if self.continuity is not None:
            self.continuity.tie(sigma, c, rate)
        elif self.law.depends_on_rate:
            c = np.clip(c, 0.0, 1.0)
        self.sigma = sigma
        self._sigma.x.array[: sigma.size] = sigma
        self.softening = c
        self._softening.x.array[: c.size] = c

    def keep_rate(self, rate: np.ndarray, characteristic_rate: float) -> None:
        """Remember the rates of a converged solve for the next one."""
        self.last_rate = (rate, characteristic_rate)

    def tie_to_last_rate(self, characteristic_rate: float, step: float | None) -> None:
        """Use the remembered rates in the solve to come, over a step in s; without either, nothing is tied."""
        self.continuity = None
        if self.last_rate is not None and step is not None:
            rate, before = self.last_rate
            self.continuity = RateContinuity(rate * characteristic_rate / before, step)

    def stress_from_rate(self, rate) -> None:
        """The deviatoric stress that belongs to the strain rates, where it is not known otherwise."""
        if self.stress_is_unknown:
            self.tau = (2 * self.sigma / (3 * rate))[:, None] * self.strain_rate
            self.stress_is_unknown = False

    def cut_stress(self, rate) -> None:
        """Cut the independent stress to the flow stress and hand it to the tangent."""
        cut(self.tau, self.sigma)
        self._tau.x.array[: self.tau.size] = self.tau.ravel()

    def handed_over(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the tangent is made of: flow stress and softening (cells, points), stress (cells, points, components)."""
        cells, components = len(self.nodes.cells), self.kinematics.components
        sigma, softening, tau = (f.x.array for f in (self._sigma, self._softening, self._tau))
        count = self.tau.size // components
        return (sigma[:count].reshape(cells, -1), softening[:count].reshape(cells, -1),
                tau[: self.tau.size].reshape(cells, -1, components))

    def update_stress(self, rate, increment_rate) -> None:
        """Stress and strain rate after the increment: the stress-velocity update."""
        advance(self.strain_rate, increment_rate, self.tau, self.sigma, self.softening, rate)

    def rate_of_increment(self) -> np.ndarray:
        """Strain rate of the increment at the points, (cells * points, components), 1/s."""
        if self.element is not None:
            return self.element.strain_rates(self.increment.x.array)
        return self._rate_of_increment.eval(self.nodes.mesh, self._owned_cells).reshape(self.strain_rate.shape)

    def refresh_strain_rate(self) -> None:
        """Strain rate at the points anew from the velocity, on the present geometry."""
        self.increment.x.array[:] = self.solution.x.array
        self.strain_rate = self.rate_of_increment().copy()

    def point_data(self) -> tuple[np.ndarray, np.ndarray]:
        """Per owned cell: deviatoric stress, and the rate that the next solve is tied to, at the integration points."""
        cells = len(self.nodes.cells)
        rate = np.zeros(len(self.tau)) if self.last_rate is None else self.last_rate[0]
        return self.tau.reshape(cells, -1), rate.reshape(cells, -1)

    def set_point_data(self, stress: np.ndarray, rate: np.ndarray, rate_scale: float) -> None:
        """Take over what :meth:`point_data` gave; the rates belong to the characteristic rate ``rate_scale``, 1/s."""
        self.tau[:] = stress.reshape(self.tau.shape)
        self.rate0.value = self.settings.regularisation * rate_scale
        self.refresh_strain_rate()
        self.last_rate = (rate.ravel(), rate_scale)

    @contextmanager
    def newtonian(self, rate: float):
        """For a while a fluid of constant viscosity, that of the flow stress at ``rate``, 1/s, without mass."""
        fields = [f.x.array for f in (self.solution, self._tau)]
        constants = [self.rate0] + ([] if self.mass is None else [self.mass.per_step])
        kept = [a.copy() for a in fields], [float(c.value) for c in constants]
        for array in fields:
            array[:] = 0.0
        for constant, value in zip(constants, (rate, 0.0), strict=False):
            constant.value = value
        yield
        for array, before in zip(fields, kept[0], strict=True):
            array[:] = before
        for constant, value in zip(constants, kept[1], strict=True):
            constant.value = value
