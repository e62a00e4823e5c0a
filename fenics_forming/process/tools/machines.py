"""What drives the tools in a run: drives that are functions of time, and rams whose motion comes out of the run."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from math import inf, isfinite, sqrt

import numpy as np

from ...laws import EnergyDrive, Follower
from ...scene import Scene, copies
from ..integration import Flow

FARTHEST = 2.0   # of the time between two forces that were felt, from the first on: a line through them holds no longer
SPENT = 2e-6     # of the energy of a blow: what may be left, or overdrawn, at its end
ALIKE = 1e-3     # difference of the shares by which several rams slow down in a step, up to which the flow is scaled by one
CREEP = 1e-3     # of the speed of impact: that of the flow at the end of a blow, whose force is that of v → 0


def drives_of(scene: Scene) -> dict:
    """Tool → what moves it in a run of the scene; tools at rest are left out."""
    rams = {name: Ram(tool.drive, copies(scene, tool.drive.direction)) for name, tool in scene.tools.items()
            if tool.drive is not None and tool.drive.spends_energy}
    return {name: scene.drive(name, among=rams) for name, tool in scene.tools.items() if tool.drive is not None}


class Rams:
    """The rams among the drives of a run: they hear of steps and forces, and go back together.

    Parameters
    ----------
    drives : tool → drive
    """

    def __init__(self, drives: dict):
        self.by_tool: dict[str, Ram] = {name: drive for name, drive in drives.items() if isinstance(drive, Ram)}
        self._alone = all(isinstance(drive, (Ram, Follower)) for drive in drives.values() if drive.moves)

    def begin(self, flow: Flow, dt: float) -> Flow:
        """A step of ``dt`` is tried: the flow with which it starts, at the mean speed of the rams where they slow down
        alike and nothing else drives it."""
        shares = [ram.begin(dt) for ram in self.by_tool.values()]
        if not self._alone or not shares or max(shares) - min(shares) > ALIKE:
            return flow
        rates = {name: shares[0] * rate for name, rate in flow.rates.items()}
        pace = max(ram.speed for ram in self.by_tool.values())
        return replace(flow, velocity=shares[0] * flow.velocity, rates=rates, share=shares[0], pace=pace or 1.0)

    @property
    def between_blows(self) -> bool:
        """Whether a blow has ended and no other one begun: there the flow is that of the limit v → 0, or none."""
        return any(ram.between_blows for ram in self.by_tool.values())

    def feel(self, contact, time: float) -> None:
        """The forces of a solve at ``time``. Collective."""
        for tool in () if contact is None else contact.tools:
            if (ram := self.by_tool.get(tool.name)) is not None:
                yielding = 0.0 if tool.free is None else float(contact.along_motions(tool, tool.free) @ tool.free.rate)
                ram.feel(time, float(contact.force(tool) @ ram.direction), yielding)

    def arrive(self, tools: list, time: float) -> None:
        """A step has ended at ``time``; what yields is not settled there yet."""
        for tool in tools:
            if (ram := self.by_tool.get(tool.name)) is not None:
                ram.arrive(time, 0.0 if tool.free is None else _stored(tool.free, tool.free.at(time)) -
                           _stored(tool.free, tool.free.displacement))

    def stored(self, tools: list) -> dict[str, float]:
        """Elastic energy now, mJ, of the modelled part of what yields, by the tools with rams."""
        return {tool.name: _stored(tool.free, tool.free.displacement) for tool in tools
                if tool.name in self.by_tool and tool.free is not None}

    def rebook(self, tools: list, before: dict[str, float]) -> None:
        """Tools that are solved after a step have yielded since their energies were those ``before``."""
        for name, stored in self.stored(tools).items():
            self.by_tool[name].rebook(stored - before[name])

    @property
    def time_left(self) -> float:
        """Length, s, that the last step should have had because it took more energy than was left; else inf."""
        return min((ram.time_left for ram in self.by_tool.values()), default=inf)

    def memory(self) -> dict[str, dict]:
        """State of every ram, as JSON can hold it."""
        return {name: ram.memory() for name, ram in self.by_tool.items()}

    def remember(self, memory: dict[str, dict]) -> None:
        """Take over what :meth:`memory` gave."""
        for name, ram in self.by_tool.items():
            ram.remember(memory[name])

    def ledger(self) -> dict[str, dict[str, float]]:
        """Where the energies have gone, mJ, by tool."""
        return {name: ram.ledger() for name, ram in self.by_tool.items()}


def _stored(free, displacement) -> float:
    """Elastic energy of what yields with a displacement (n,), mJ."""
    return 0.5 * float(displacement @ free.stiffness @ displacement)


@dataclass
class RamState:
    """Where a ram is in its blows, at the time ``since``, s.

    travelled : place along the direction, mm · speed, mm/s, and slowing, mm/s², with which it goes on · pace : mean speed
    of the step that is tried, mm/s, else None · left : energy of the present blow, mJ
    work : given to the body, mJ · stored : energy in the press frame, mJ · lost : elsewhere, mJ
    blow : number of blows that are over · ended : whether one was over just now
    next : time of the next blow in a pause, else None · turns : ends of blows and of pauses, s
    felt : (time, s, force on the body, N, power of the force on what yields, mW) of the last two solves
    """

    left: float
    speed: float
    since: float = 0.0
    travelled: float = 0.0
    slowing: float = 0.0
    pace: float | None = None
    work: float = 0.0
    stored: float = 0.0
    lost: float = 0.0
    blow: int = 0
    ended: bool = False
    next: float | None = None
    felt: list = field(default_factory=list)
    turns: list = field(default_factory=list)


class Ram:
    r"""The ram of a hammer or a screw press in a run; answers all that a `Drive` does, for the present step.

    What is ahead counts with a constant force, :math:`s=s_0+w\tau-\tfrac{F}{2\eta M}\tau^2`. Within a step the ram moves
    with the mean speed of that path, as the time schemes carry the nodes. At its end the energy is what the work of the
    force in the middle of the step has left, so that energy is kept whatever the steps are; the speed follows from the
    energy. Second order in the step.

    Parameters
    ----------
    drive : the description · copies : parts of the whole body that the mesh stands for
    """

    def __init__(self, drive: EnergyDrive, copies: int = 1):
        self.drive, self._copies = drive, copies
        self.kind, self.direction, self.dimension, self.moves = drive.kind, drive.direction, drive.dimension, True
        self.rotation_centre, self.rotation_axis, self.dead_centre_time = drive.rotation_centre, drive.rotation_axis, None
        self.spends_energy, self.stalls = True, False
        first = drive.energies[0]
        self._now = RamState(left=first, speed=drive.impact_speed(first))
        self._overdrawn: tuple[float, float, float] | None = None     # of a step that took too much: start, slowing, length

    # ------------------------------------------------------------------ as a drive
    def velocity(self, time):
        now = self._now
        if time < now.since:            # just before: at the end of a blow the flow of v → 0, in a pause rest
            speed = CREEP * self._impact(now.blow - 1) if now.ended else 0.0 if now.since in now.turns else now.speed
        elif now.next is not None:
            speed = self._impact(now.blow) if time >= now.next else 0.0
        else:
            speed = self.speed
        return speed * self.direction

    def travel(self, time):
        now = self._now
        if time <= now.since:           # it is lifted a moment later
            return now.travelled
        if now.next is not None:
            flown = self._impact(now.blow) * (time - now.next) if time > now.next else 0.0
            return now.travelled - self.drive.lift + flown
        late = time - now.since
        if now.pace is not None:
            return now.travelled + now.pace * late
        late = min(late, self._time_to_rest())
        return now.travelled + (now.speed - now.slowing * late / 2) * late

    def displacement(self, time):
        return self.travel(time) * self.direction

    def time_of_travel(self, travel, start=0.0):
        now = self._now
        rest = travel - self.travel(start)
        if rest <= 0:
            return start
        if now.next is not None:
            return max(start, now.next) + rest / self._impact(now.blow) if isfinite(now.next) else inf
        speed = now.speed - now.slowing * max(start - now.since, 0.0)
        root = speed**2 - 2 * now.slowing * rest
        return start + 2 * rest / (speed + sqrt(root)) if speed > 0 and root >= 0 else inf

    @property
    def turning_times(self):
        now = self._now
        ahead = now.next if now.next is not None else now.since + self._time_to_rest()
        return (*now.turns, *([ahead] if isfinite(ahead) else []))

    def angular_velocity(self, time):
        return self.drive.angular_velocity(time)

    def angle(self, time):
        return self.drive.angle(time)

    # ------------------------------------------------------------------ in a run
    def feel(self, time: float, force: float, yielding: float = 0.0) -> None:
        """A solve at ``time`` has found the force of the tool on the modelled part of the body, N, along the direction.

        yielding : its power on the motion of a frame or die that yields, mW, negative where that is pushed back
        """
        now, force = self._now, force * self._copies
        before = [sample for sample in now.felt if sample[0] < time and (sample[1] > 0 or force <= 0)]
        now.felt = [*before[-1:], (time, force, yielding * self._copies)]
        if time == now.since and now.next is None:
            now.slowing = max(force, 0.0) / self._resisting_mass

    def begin(self, dt: float) -> float:
        """A step of ``dt`` is tried; the mean speed in it relative to that at its start."""
        now = self._now
        if now.next is not None or now.speed == 0.0:
            return 1.0
        now.pace = now.speed - now.slowing * min(dt, self._time_to_rest()) / 2
        return now.pace / now.speed

    def arrive(self, time: float, stored: float = 0.0) -> None:
        """A step has ended at ``time``: the body has taken the work of the way, less what has yielded, and the frame
        ``stored``, mJ, of the modelled part."""
        now, stored = self._now, stored * self._copies
        force, yielding = self._felt_at((now.since + time) / 2)
        if now.next is not None or force <= 0 and stored < 0:       # the frame of a lifted ram springs back
            now.stored, now.lost, stored = now.stored + stored, now.lost - stored, 0.0
        if now.next is not None:
            if time >= now.next:
                self._strike(time)
            return
        way = self.travel(time) - now.travelled
        # at the end of a blow the frame forms, not the ram: what it gives beyond the work that was felt speeds nothing up
        work = max(force * way + yielding * (time - now.since), -stored)
        taken = (work + stored) / self.drive.forming_share
        slowing = max(force, 0.0) / self._resisting_mass
        self._overdrawn = None
        if now.left - taken < -SPENT / 2 * self.drive.energies[now.blow]:
            left, length = max(now.left, 0.0), time - now.since
            self._overdrawn = now.since, slowing, length * left / taken
        now.work, now.stored, now.left = now.work + work, now.stored + stored, now.left - taken
        now.lost += (1 - self.drive.forming_share) * taken
        now.since, now.travelled, now.pace, now.ended = time, now.travelled + way, None, False
        now.speed = sqrt(2 * max(now.left, 0.0) / self.drive.moving_mass)
        now.slowing = slowing
        if now.left <= SPENT * self.drive.energies[now.blow]:
            now.blow, now.ended, now.turns = now.blow + 1, True, [*now.turns, time]
            now.next = time + self.drive.pause if now.blow < len(self.drive.energies) else inf
            if now.next == time:
                self._strike(time)

    def rebook(self, stored: float) -> None:
        """Energy, mJ, of the modelled part, that the frame has and the body, to which it went in the step, has not."""
        now, stored = self._now, stored * self._copies
        if now.next is not None and stored < 0:
            now.lost -= stored
        else:
            now.work -= stored
        now.stored += stored

    def _strike(self, time: float) -> None:
        """The next blow begins."""
        now = self._now
        now.ended = now.since == time
        now.turns, now.since, now.next = [*now.turns, time], time, None
        now.travelled -= self.drive.lift
        now.left, now.slowing = now.left + self.drive.energies[now.blow], 0.0
        now.speed = sqrt(2 * now.left / self.drive.moving_mass)

    @property
    def is_spent(self) -> bool:
        """Whether the last blow is over."""
        return self._now.blow == len(self.drive.energies)

    @property
    def between_blows(self) -> bool:
        """Whether a blow has ended and no other one begun."""
        return self._now.next is not None

    @property
    def speed(self) -> float:
        """With which it moves in the step, mm/s."""
        return self._now.speed if self._now.pace is None else self._now.pace

    @property
    def time_left(self) -> float:
        """Length, s, that the last step should have had because it took more energy than was left; else inf."""
        return inf if self._overdrawn is None else self._overdrawn[2]

    def ledger(self) -> dict[str, float]:
        """Where the energies have gone, mJ, of all that came to blows."""
        now = self._now
        brought = sum(self.drive.energies[:now.blow + (now.next is None)])
        return {"brought": brought, "work on the body": float(now.work), "stored in the frame": float(now.stored),
                "lost": float(now.lost), "left": float(now.left)}

    def memory(self) -> dict:
        """The state, as JSON can hold it."""
        state = asdict(self._now)
        return state | {"next": "never" if state["next"] == inf else state["next"]}

    def remember(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        never = memory["next"] == "never"
        self._now = RamState(**memory | {"next": inf if never else memory["next"], "turns": list(memory["turns"]),
                                         "felt": [tuple(pair) for pair in memory["felt"]]})
        if self._overdrawn is not None and self._overdrawn[0] == self._now.since:      # tried again, with the force of then
            self._now.slowing = self._overdrawn[1]

    @property
    def _resisting_mass(self) -> float:
        return self.drive.moving_mass * self.drive.forming_share

    def _impact(self, blow: int) -> float:
        return self.drive.impact_speed(self.drive.energies[blow])

    def _time_to_rest(self) -> float:
        return self._now.speed / self._now.slowing if self._now.slowing > 0 else inf

    def _felt_at(self, time: float) -> np.ndarray:
        """Force, N, and power of yielding, mW, at a time on the line through the last two that were felt."""
        felt = np.array(self._now.felt)
        if len(felt) < 2:
            return felt[0, 1:] if len(felt) else np.zeros(2)
        share = min((time - felt[0, 0]) / (felt[1, 0] - felt[0, 0]), FARTHEST)
        return felt[0, 1:] + share * (felt[1, 1:] - felt[0, 1:])
