"""Drives whose motion only the solve knows: springs, free rolls, and presses that yield at their force limit."""

from __future__ import annotations

import numpy as np

from ..laws import Drive, RollDrive, SpringDrive
from ..physics.contact.free_motions import FreeMotions, RigidMotions
from ..scene import Scene, copies

STIFF = 1e9      # of the force limit over the speed: resistance of a press below its limit


def equip(scene: Scene, tools: list, drives: dict) -> None:
    """Give the tools of a run what moves them: their drives, and what the solve has to find."""
    for tool in tools:
        drive = scene.tools[tool.name].drive
        if drive is None:
            continue
        tool.free = free_motion_of(scene, drive)
        if isinstance(tool.free, LimitedForce):
            drives[tool.name] = Limited(drive, tool.free)
        tool.drive = drives[tool.name]


def free_motion_of(scene: Scene, drive: Drive) -> FreeMotions | None:
    """What the solve has to find of the motion of a tool with this drive; None where the drive knows it."""
    if isinstance(drive, SpringDrive):
        share = copies(scene, drive.direction)
        return RigidMotions([drive.direction], stiffness=drive.stiffness / share)
    if isinstance(drive, RollDrive) and drive.is_free:
        return FreeRoll(drive, copies(scene))
    if drive.force_limit is not None:
        return LimitedForce(drive, copies(scene, drive.direction))
    return None


class FreeRoll(RigidMotions):
    """A roll that the body turns, with a torque on it.

    The torque acts once friction can hold it: the first solve of a contact goes without, or the roll would run away.

    Parameters
    ----------
    drive : with the torque, N mm, of the whole body · share : parts of it that the mesh stands for
    """

    def __init__(self, drive: RollDrive, share: int):
        super().__init__(np.empty((0, drive.dimension)), rotates=True)
        self._torque, self.held = (drive.torque or 0.0) / share, False

    def prepare(self, horizon: float) -> None:
        super().prepare(horizon)
        if self.held:
            self.load = self.load + self._torque

    def found(self, reaction: np.ndarray) -> bool:
        again = not self.held and self._torque != 0.0
        self.held = True
        return again

    def unopposed(self) -> np.ndarray:
        self.held = False
        return self.rate

    def memory(self):
        return super().memory() | {"held": self.held}

    def remember(self, memory) -> None:
        super().remember(memory)
        self.held = bool(memory["held"])


class LimitedForce(RigidMotions):
    r"""How far a press with a force limit stays behind the motion that it has without one.

    Below the share s of its limit :math:`F_0` it has the given speed w. From there on its force is
    :math:`F=sF_0-R\,a`, :math:`R=(1-s)F_0/w`, with the speed w + a: it stands still at the limit.

    Parameters
    ----------
    drive : with `force_limit`, `yields_from` and the given speed · share : parts of the whole body that the mesh stands for
    """

    follows_drive = False    # at its limit a press may be much slower

    def __init__(self, drive: Drive, share: int):
        super().__init__([drive.direction])
        self._drive, self.yields = drive, False
        self._limit = drive.force_limit / share
        self._from = drive.yields_from

    @property
    def _given_speed(self) -> float:
        return float(np.linalg.norm(self._drive.velocity(self.now)))

    def prepare(self, horizon: float) -> None:
        self.horizon = horizon
        slope = self._limit / max(self._given_speed, 1e-30)
        if not self.yields:
            self.rate = np.zeros(1)
        self.resistance = np.array([[(1 - self._from) * slope if self.yields else STIFF * slope]])
        self.load = np.array([self._from * self._limit if self.yields else 0.0])

    def found(self, reaction: np.ndarray) -> bool:
        """Whether the solve took the wrong branch, and has to be done again with the other."""
        before = self.yields
        self.yields = bool(self.rate[0] <= 0) if before else bool(reaction[0] > self._from * self._limit)
        return self.yields != before

    def unopposed(self) -> np.ndarray:
        return np.zeros(1)

    @property
    def stands_still(self) -> bool:
        """Whether the force limit holds the press back altogether."""
        return self.yields and self._given_speed + self.rate[0] < 2e-3 * self._given_speed

    def memory(self):
        return super().memory() | {"yields": self.yields}

    def remember(self, memory) -> None:
        super().remember(memory)
        self.yields = bool(memory["yields"])


class Limited:
    """A press with a force limit in a run: the drive that it has without, and how far it stays behind.

    Answers all that a `Drive` does; velocity and displacement are those without the limit, to which the tool adds the
    motion that the solve finds.
    """

    def __init__(self, drive: Drive, behind: LimitedForce):
        self._drive, self._behind = drive, behind

    def __getattr__(self, name):
        return getattr(self._drive, name)

    def travel(self, time):
        return self._drive.travel(time) + float(self._behind.at(time)[0])

    def time_of_travel(self, travel, start=0.0):
        rest = travel - self.travel(start)
        return self._drive.time_of_travel(self._drive.travel(start) + rest, start) if rest > 0 else start

    @property
    def stalls(self):
        return self._behind.stands_still
