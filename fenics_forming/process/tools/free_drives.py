"""Drives whose motion only the solve knows: springs, free rolls, and presses that yield at their force limit."""

from __future__ import annotations

import numpy as np

from ...laws import Drive, RollDrive, SpringDrive
from ...physics.contact.free_motions import FreeMotions, RigidMotions
from ...scene import Scene, copies

HELD_BACK = 1e-2 # of the given speed: slower, and the press counts as held back; what it creeps on is the regularisation
STANDS = 2e-3    # of the given speed: what a tool counts to have at least
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
        laws = [scene.materials[body.material].flow_stress for body in scene.workpieces.values()]
        places = not any(law.depends_on_rate for law in laws)
        return LimitedForce(drive, copies(scene, drive.direction), places=places)
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

    The force on a body that does not depend on the rate tells where the tool is, not how fast: there it is met at the end
    of the step, by a body that resists as its shape will be then (``time_left``).

    Parameters
    ----------
    drive : with `force_limit`, `yields_from` and the given speed · share : parts of the whole body that the mesh stands for
    places : whether the force tells the place
    """

    share_of_drive = STANDS  # at its limit a press may be much slower; one that stands still must not count for nothing

    def __init__(self, drive: Drive, share: int, *, places: bool):
        super().__init__([drive.direction])
        self._drive, self.yields, self._places = drive, False, places
        self._share, self._from, self._passed = share, drive.yields_from, 0.0       # the last: way since the step began, mm

    @property
    def _limit(self) -> float:
        return self._drive.force_at(self.since + self.horizon if self._places else self.now) / self._share

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

    def moved(self, motion, time: float):
        given = self._drive.travel(time) - self._drive.travel(self.since)
        self._passed = float(given + self.at(time)[0] - self.displacement[0])
        return super().moved(motion, time)

    @property
    def time_left(self) -> float:
        return max(self.since + self.horizon - self.now, 0.0) if self._places and self.yields else 0.0

    def expect(self, rise: float) -> None:
        """The resistance will rise by a share ``rise`` of itself on every mm of the way that is left of the step, what the
        tool will have gone at its end less what it has gone."""
        rise = self._limit * rise
        self.resistance = self.resistance + rise * self.horizon
        self.load = self.load - rise * (self.horizon * self._given_speed - self._passed)

    def follow(self, ratio: float) -> None:
        """The speed itself is what is sought."""

    def found(self, reaction: np.ndarray) -> bool:
        """Whether the solve took the wrong branch, and has to be done again with the other."""
        before = self.yields
        self.yields = bool(self.rate[0] <= 0) if before else bool(reaction[0] > self._from * self._limit)
        return self.yields != before

    def power(self, forces: np.ndarray) -> float:
        return float(abs(forces[0] * (self._given_speed + self.rate[0])))     # on what the tool really does

    def unopposed(self) -> np.ndarray:
        return np.zeros(1)

    @property
    def stands_still(self) -> bool:
        """Whether the force limit holds the press back altogether."""
        given = self._given_speed
        return self.yields and self.now >= self._drive.last_change and given + self.rate[0] < HELD_BACK * given

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
