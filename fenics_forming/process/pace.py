"""Tools that change their speed within a step, and the flow that follows them: a crank near its dead centre."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .integration import Flow

ALIKE = 1e-3     # difference of the ratios by which several tools change their speed, up to which the flow is scaled by one
EVEN = 1e-9      # difference of such a ratio from 1 that is rounding
RESTS = 1e-6     # of the speed at the start of a step: the tools have come to rest
BEFORE = 1e-12   # of a step, before its end: a drive that turns there has not done so yet
HALVINGS = 40    # of a step, in search of the time at which part of the way is done


@dataclass(frozen=True)
class Pace:
    """Mean speed of the tools in a step: its share of that with which a flow was found, and in mm/s (1 if not known)."""

    share: float = 1.0
    speed: float = 1.0

    def of(self, flow: Flow) -> Flow:
        """The flow as fast as that."""
        if self.share == 1.0:
            return flow
        rates = {name: self.share * rate for name, rate in flow.rates.items()}
        return replace(flow, velocity=self.share * flow.velocity, rates=rates, share=self.share * flow.share,
                       pace=self.speed)


def mean_pace(drives: dict, at: float, time: float, dt: float) -> Pace:
    """Of a flow found ``at`` a time, s, for the step from ``time`` to ``time + dt``, where the tools change their speed
    alike.

    Where nothing but tools drives it, a body goes as far as they do, and flows as its shape lets it: with the speed at the
    start of the step alone, the last one of a crank before its dead centre would carry it twice as far as the tool.

    Parameters
    ----------
    drives : tool → drive, as functions of time
    """
    ratios, speed = [], 0.0
    for drive in drives.values():
        for before, way in zip(_velocities(drive, at), _ways(drive, time, dt), strict=True):
            if before @ before == 0.0:
                if np.any(way != 0.0):
                    return Pace()
                continue
            ratios.append(float(way @ before / (dt * (before @ before))))
            speed = max(speed, float(np.linalg.norm(way)) / dt)
    if not ratios or min(ratios) <= 0.0 or max(ratios) - min(ratios) > ALIKE * max(ratios) or abs(ratios[0] - 1) < EVEN:
        return Pace()
    return Pace(ratios[0], speed)


def lapse(drives: dict, time: float, dt: float, share: float) -> float:
    """How long, s, tools that change their speed in the step from ``time`` to ``time + dt``, s, take for a share of their
    way; the same share of the step where they do not, or not alike."""
    moved = [drive for drive in drives.values() if any(np.any(way != 0.0) for way in _ways(drive, time, dt))]

    def done(drive, lasting):
        (line, turn), (whole, angle) = _ways(drive, time, lasting), _ways(drive, time, dt)
        return float(line @ whole / (whole @ whole)) if np.any(whole != 0.0) else float(turn @ angle / (angle @ angle))

    shares = [done(drive, share * dt) for drive in moved]
    if not moved or max(shares) - min(shares) > ALIKE or abs(shares[0] - share) < EVEN:
        return share * dt
    low, high = 0.0, dt
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if done(moved[0], middle) < share else (low, middle)
    return 0.5 * (low + high)


def come_to_rest(drives: dict, time: float, dt: float) -> bool:
    """Whether all that moves at ``time``, s, is at rest at the end of the step ``dt``, s."""
    def sizes(at):
        return [np.linalg.norm(v) for drive in drives.values() for v in _velocities(drive, at)]

    ends = [(a, b) for a, b in zip(sizes(time), sizes(time + (1 - BEFORE) * dt), strict=True) if a > 0 or b > 0]
    return bool(ends) and all(after <= RESTS * before for before, after in ends)


def _velocities(drive, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Of a tool, (dim,) mm/s, and its spin (1,), rad/s."""
    return np.asarray(drive.velocity(time), float), np.atleast_1d(float(drive.angular_velocity(time)))


def _ways(drive, time: float, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Of a tool from a time on, (dim,) mm, and the angle (1,), rad, by which it turns."""
    end = time + (1 - BEFORE) * dt
    return np.subtract(drive.displacement(end), drive.displacement(time)), \
        np.atleast_1d(float(drive.angle(end) - drive.angle(time)))
