"""The length of the next step: the wanted step, what must be hit exactly, and what the flow allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Of a step: how near to a time that must be hit another end is that time. At a dead centre the rounding of a stroke is
# the square root of that in time.
NEAR = 1e-6

# Of the wanted step: landing points make it no shorter. Where a surface runs into a tool without end, as a strip into
# rolls, some point lands in every step however short, and takes no less of the power of a shorter one.
LANDING = 0.1


@dataclass(frozen=True)
class Adaptivity:
    """Limits of an adaptive step.

    max_strain_increment : of the effective strain in a step, at the 98th percentile of the nodes
    tolerance : position error of a step relative to the size of the body
    landing : power that landing points take from the tools, relative; they press from the start of the step in which
        they land, so the force is too large by about this much
    """

    max_strain_increment: float = 0.05
    tolerance: float = 1e-3
    landing: float = 0.01


@dataclass(frozen=True)
class Limit:
    """A step length, s, and what set it."""

    dt: float
    reason: str


class StepChoice:
    """Chooses steps; remembers cuts and lets the step grow again.

    Parameters
    ----------
    nominal : f(time) → the wanted step, s
    landmarks : times that must be hit exactly, s; or f() → them, where they become known in the run
    adaptivity : None for equal steps
    min_fraction : of the nominal step; a step that would have to be shorter fails
    """

    def __init__(self, nominal, landmarks=(), adaptivity: Adaptivity | None = None, min_fraction: float = 1e-3):
        self._nominal, self._given_landmarks = nominal, landmarks
        self._adaptivity, self.min_fraction = adaptivity, min_fraction
        self._fraction = 1.0
        self._reason = "step"

    @property
    def _landmarks(self) -> list[float]:
        times = self._given_landmarks() if callable(self._given_landmarks) else self._given_landmarks
        return sorted(map(float, times))

    @property
    def fraction(self) -> float:
        """Share of the nominal step that is tried next."""
        return self._fraction

    @property
    def is_adaptive(self) -> bool:
        """Whether the flow sets the steps."""
        return self._adaptivity is not None

    def resume(self, fraction: float) -> None:
        """Go on with the share of the nominal step that an earlier run had come to; one that had failed tries anew."""
        self._fraction = fraction if fraction >= self.min_fraction else 1.0
        self._reason = "cut" if self._adaptivity is None else "error"

    def next(self, time: float, rates: np.ndarray | None = None) -> Limit:
        """The step from ``time`` on; ``rates``, effective strain rates at the nodes, 1/s."""
        nominal = self._nominal(time)
        dt, reason = nominal * self._fraction, "step" if self._fraction == 1.0 else self._reason
        if self._adaptivity is not None and rates is not None and rates.size:
            fast = float(np.quantile(rates, 0.98))
            allowed = self._adaptivity.max_strain_increment / fast if fast > 0 else np.inf
            if allowed < dt:
                dt, reason = max(allowed, nominal * self.min_fraction), "strain"
        least = time + 1e-9 * min(nominal, 1e30)
        ahead = next((moment for moment in self._landmarks if moment > least), None)
        if ahead is not None:
            left = ahead - time
            if dt >= left * (1 - NEAR):
                return Limit(left, reason if dt <= left * (1 + NEAR) else "target")
            if dt > 0.5 * left and dt < left and self._adaptivity is not None:
                return Limit(0.5 * left, reason)   # two even steps instead of one long and one tiny
        return Limit(dt, reason)

    def left(self, time: float) -> float:
        """Time until the next moment that must be hit, s; inf where none is known."""
        ahead = [moment for moment in self._landmarks if moment > time * (1 + 1e-12)]
        return ahead[0] - time if ahead else np.inf

    def end_of(self, time: float, dt: float) -> float:
        """time + dt, free of rounding where that is to be hit exactly: drives may jump there."""
        end = time + dt
        return next((moment for moment in self._landmarks if abs(moment - end) <= 1e-9 * dt), end)

    def failed(self, time: float, tried: float) -> bool:
        """Halve the step ``tried`` from ``time`` on; False where it would become too short."""
        # a step that the strain had limited must become shorter too, not only the wanted one
        shortened = max(tried / self._nominal(time), 2 * self.min_fraction)
        self._fraction = 0.5 * min(self._fraction, shortened)
        self._reason = "cut"
        return self._fraction >= self.min_fraction

    def succeeded(self, error: float, size: float, landing: float = 0.0) -> None:
        """Let the step grow again; with adaptivity, by the error estimate (mm) of a first-order predictor and by the
        share of the power that landing points took, which grows with the step."""
        limits, factors = self._adaptivity, {}
        if limits is not None and np.isfinite(error) and error > 0:
            factors["error"] = 0.9 * np.sqrt(limits.tolerance * size / error)
        if limits is not None and landing > 0:
            factors["contact"] = 0.9 * limits.landing / landing
        if factors:
            self._reason = min(factors, key=factors.get)
            factor = np.clip(factors[self._reason], 0.3, 1.5)
            least = self.min_fraction if self._reason == "error" else max(self.min_fraction, min(LANDING, self._fraction))
            self._fraction = float(np.clip(self._fraction * factor, least, 1.0))
        else:
            self._fraction = min(1.0, 2.0 * self._fraction)
