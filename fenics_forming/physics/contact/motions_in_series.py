"""Motions of one tool by two causes, one behind the other: a press that its force limit holds back, and a frame or die on
it that yields under the same force."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from .free_motions import FreeMotions

CREEPS = 0.2       # of the given speed, that a press in front of a surface that deforms counts to have at least: gaps of
                    # a surface that springs back would be great forces against the penalty of a tool that stands


class MotionsInSeries:
    """Answers what a solve asks of `FreeMotions`.

    Parameters
    ----------
    press : how far the drive stays behind · yielding : of the frame or of the surface of the tool
    """

    given = False

    def __init__(self, press: FreeMotions, yielding: FreeMotions):
        self.press, self.yielding = press, yielding
        self.parts = press, yielding

    @property
    def deforms(self) -> bool:
        """See `FreeMotions.deforms`."""
        return self.yielding.deforms

    @property
    def horizon(self) -> float:
        """s, of the last solve."""
        return self.press.horizon

    # ------------------------------------------------------------------ unknowns
    @property
    def count(self) -> int:
        """Number of unknown motions."""
        return self.press.count + self.yielding.count

    def _shared_out(self, values: np.ndarray):
        """The parts, each with its share of (count,) values."""
        return zip(self.parts, np.split(values, [self.press.count]), strict=True)

    @property
    def rate(self) -> np.ndarray:
        """(count,) mm/s."""
        return np.concatenate([part.rate for part in self.parts])

    @rate.setter
    def rate(self, values: np.ndarray) -> None:
        for part, own in self._shared_out(values):
            part.rate = own

    @property
    def basis(self):
        """The motions at the contact points, (points · dim, count), sparse where one is; None before a search."""
        return None if self.press.basis is None else _beside(*(part.basis for part in self.parts))

    def reached(self):
        """See `FreeMotions.reached`."""
        return _beside(*(part.reached() for part in self.parts))

    @property
    def resistance(self) -> np.ndarray:
        """See `FreeMotions`: each of the parts resists by itself."""
        whole, first = np.zeros((self.count, self.count)), self.press.count
        whole[:first, :first], whole[first:, first:] = self.press.resistance, self.yielding.resistance
        return whole

    @property
    def load(self) -> np.ndarray:
        """See `FreeMotions`."""
        return np.concatenate([part.load for part in self.parts])

    # ------------------------------------------------------------------ in a solve
    def velocities(self, rate: np.ndarray | None = None) -> np.ndarray:
        """See `FreeMotions.velocities`."""
        return sum(part.velocities(own) for part, own in self._shared_out(self.rate if rate is None else rate))

    def moved(self, motion, time: float):
        """See `RigidMotions.moved`."""
        return self.yielding.moved(self.press.moved(motion, time), time)

    def search(self, points: np.ndarray, motion, gap: np.ndarray, normal: np.ndarray) -> None:
        """See `RigidMotions.search`. Collective."""
        for part in self.parts:
            part.search(points, motion, gap, normal)

    def prepare(self, horizon: float) -> None:
        """See `FreeMotions.prepare`."""
        for part in self.parts:
            part.prepare(horizon)

    def follow(self, ratio: float) -> None:
        """See `FreeMotions.follow`."""
        for part in self.parts:
            part.follow(ratio)

    @property
    def speed(self) -> float:
        """See `FreeMotions`."""
        return self.press.speed

    @speed.setter
    def speed(self, speed: float) -> None:
        for part in self.parts:
            part.speed = speed

    def found(self, reaction: np.ndarray) -> bool:
        """See `FreeMotions.found`."""
        return any([part.found(own) for part, own in self._shared_out(reaction)])

    def unopposed(self) -> np.ndarray:
        """See `FreeMotions.unopposed`."""
        return np.concatenate([part.unopposed() for part in self.parts])

    def power(self, forces: np.ndarray) -> float:
        """See `FreeMotions.power`."""
        return sum(part.power(own) for part, own in self._shared_out(forces))

    @property
    def time_left(self) -> float:
        """See `FreeMotions.time_left`."""
        return self.press.time_left

    def expect(self, rise: float) -> None:
        """See `process.free_drives.LimitedForce.expect`."""
        self.press.expect(rise)

    def slowed(self, given: np.ndarray) -> list[np.ndarray]:
        """Velocities that measure how fast the tool is, (points, dim): those of the press, and of one that stands nearly
        still a little of its own, ``given``."""
        least = CREEPS if self.deforms else self.press.share_of_drive
        return [given + self.press.velocities(), least * given]

    # ------------------------------------------------------------------ in time
    def settle(self, time: float) -> None:
        """See `FreeMotions.settle`."""
        for part in self.parts:
            part.settle(time)

    def forget(self) -> None:
        """See `FreeMotions.forget`."""
        for part in self.parts:
            part.forget()


def _beside(first: np.ndarray, second):
    """Two matrices with the same rows beside one another."""
    return sp.hstack([first, second], format="csr") if sp.issparse(second) else np.hstack([first, second])
