"""Ledgers: what must balance in every step, and by how much it did not."""

from __future__ import annotations

MOST_DRIFT = 0.01      # of the volume; above, the force of upsetting is off by a few per cent
MOST_LEFT = 1e-9       # of a volume that is restored
CREEPING = 0.05        # of the largest power: less is that of a tool that comes to rest
MOST_PENALTY = 0.02    # of the power of the tools; on the coarse billet 1 % went with forces 4 % too large, 3 % with 10 %


class VolumeLedger:
    """Volume against that of the start, which a rigid-plastic body keeps, and what has changed it.

    What is booked has its cause: "corners", nodes that had sunk into tools were put back; "remeshing"; "given back", by
    an offset of the free surface; "tools", nodes went along with tools that had deformed. The rest is left to
    "integration", the motion of the nodes in time.

    Parameters
    ----------
    start : volume at the start, mm³ (mm² in plane strain)
    restored : whether the volume is restored in every step
    """

    CAUSES = ("corners", "remeshing", "given back")

    def __init__(self, start: float, *, restored: bool = False):
        self.start, self.last, self.worst = start, 0.0, 0.0
        self.restored = restored
        self.booked = dict.fromkeys(self.CAUSES, 0.0)

    def book(self, changes: dict[str, float]) -> None:
        """Add changes of volume, mm³, by cause."""
        for cause, change in changes.items():
            self.booked[cause] = self.booked.get(cause, 0.0) + change / self.start

    def memory(self) -> dict:
        """What a run that is resumed must know."""
        return {"last": self.last, "worst": self.worst, "booked": self.booked}

    def remember(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        self.last, self.worst, self.booked = memory["last"], memory["worst"], dict(memory["booked"])

    def error(self, volume: float) -> float:
        """Relative change of volume since the start."""
        self.last = volume / self.start - 1.0
        self.worst = max(self.worst, abs(self.last))
        return self.last

    def errors(self, volumes: dict[str, float]) -> dict[str, float]:
        """The same of the one body in ``volumes``, by name."""
        return {name: self.error(volume) for name, volume in volumes.items()}

    def doubts(self, remedy: str) -> list[str]:
        """A sentence where the volume has drifted too far."""
        if self.restored and abs(self.last) > MOST_LEFT:
            return [f"a volume error of {100 * self.last:+.2g} % could not be given back: the body has too little free "
                    "surface, or one that would have to move by more than an element in a step"]
        if abs(self.last) <= MOST_DRIFT:
            return []
        return [f"the volume has drifted by {100 * self.last:+.1f} %: {remedy}"]

    def summary(self) -> dict:
        return {"relative_error": self.last, "worst_relative_error": self.worst, "by": self.by()}

    def by(self) -> dict[str, float]:
        """Relative change of volume by cause; their sum is the whole."""
        return {"integration": self.last - sum(self.booked.values()), **self.booked}


class VolumeLedgers:
    """Volumes of several bodies, by name, each against that of its start."""

    def __init__(self, start: dict[str, float], *, restored: bool = False):
        self.start, self.restored = start, restored
        self._ledgers = {name: VolumeLedger(volume, restored=restored) for name, volume in start.items()}

    def book(self, changes: dict[str, dict[str, float]]) -> None:
        """Add changes of volume, mm³, by body and cause."""
        for name, of_body in changes.items():
            self._ledgers[name].book(of_body)

    def memory(self) -> dict:
        """What a run that is resumed must know."""
        return {name: ledger.memory() for name, ledger in self._ledgers.items()}

    def remember(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        for name, ledger in self._ledgers.items():
            ledger.remember(memory[name])

    def errors(self, volumes: dict[str, float]) -> dict[str, float]:
        """Relative changes of volume since the start, by body."""
        return {name: ledger.error(volumes[name]) for name, ledger in self._ledgers.items()}

    def doubts(self, remedy: str) -> list[str]:
        """A sentence for every body whose volume has drifted too far."""
        return [f"'{name}': {doubt}" for name, ledger in self._ledgers.items() for doubt in ledger.doubts(remedy)]

    def summary(self) -> dict:
        return {name: ledger.summary() for name, ledger in self._ledgers.items()}


class DamageLedger:
    """Largest damage, and when it first passed the critical value."""

    def __init__(self, critical: float | None):
        self.critical, self.largest, self.passed_at_step = critical, 0.0, None

    def news(self, step: int, largest: float) -> list[str]:
        """A sentence in the step in which the critical value is passed; ``largest`` of the body in this step."""
        self.largest = largest
        if self.critical is None or self.passed_at_step is not None or largest < self.critical:
            return []
        self.passed_at_step = step
        return [f"damage has passed its critical value {self.critical:g} in step {step}: it is {largest:.3g} somewhere"]

    def summary(self) -> dict:
        return {"largest": self.largest, "critical": self.critical, "passed_at_step": self.passed_at_step}


def _given(powers: dict[str, float]) -> float:
    """Power that goes into a body, mW: from tools, forces on its volume, and its own motion that it loses."""
    return sum(powers.get(name, 0.0) for name in ("tools", "body force", "weight")) - powers.get("inertia", 0.0)


class PowerLedger:
    """Power given by the tools against plastic, friction, penalty and body-force power, relative to the first."""

    def __init__(self):
        self.last: dict[str, float] = {}
        self.worst = 0.0
        self.work = self.tool_work = self.penalty_work = self._largest = 0.0
        self._creeps = False

    def memory(self) -> dict:
        """What a later run goes on from, as JSON can hold it."""
        return dict(vars(self))

    def remember(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        vars(self).update(memory)

    def imbalance(self, body, dt: float) -> float:
        """Imbalance of the present flow of ``body``, relative to the power of the tools; 0 where nothing flows.

        The flow counts for ``dt``, s, in the share of the penalty.
        """
        if body.workpiece.is_cold or body.inertia is not None and body.inertia.is_start:
            return 0.0
        self.last = body.powers()
        stalls = any(tool.drive is not None and tool.drive.stalls for tool in body.tools)
        given = _given(self.last)
        self._largest = max(self._largest, abs(given))
        self._creeps = stalls or body.rams.between_blows or abs(given) < CREEPING * self._largest
        landing = self.last.get("landing", 0.0)
        self.work += dt * abs(self.last["tools"] + landing if body.inertia is None else given)
        self.tool_work += dt * abs(self.last["tools"])
        self.penalty_work += dt * abs(self.last["penalty"] + landing)
        spent = self.last["plastic"] + self.last["friction"] + self.last["penalty"]
        scale = max(abs(given), abs(spent), 1e-6 * body.solver.usual_power)   # the last for a body that is only moved
        relative = (given - spent) / scale if scale > 0 else 0.0
        self.worst = max(self.worst, abs(relative))
        return relative

    def penalty_shares(self) -> tuple[float, float]:
        """Share of the work of the tools that penalty and landing points took: in the last flow, on the whole; on the
        whole only with inertia, at the end of a blow or of the stroke of a crank and at a force limit, where the body all
        but rests."""
        mean = float(self.penalty_work / self.work) if self.work > 0 else 0.0
        if "inertia" in self.last or self._creeps:
            return mean, mean
        landing = self.last.get("landing", 0.0)
        given = abs(self.last.get("tools", 0.0) + landing)
        return float(abs(self.last["penalty"] + landing) / given if given > 0 else 0.0), mean

    def doubts(self, remedy: str) -> list[str]:
        """A sentence where the penalty took too much of the power of the tools."""
        share = max(self.penalty_shares())
        if share <= MOST_PENALTY:
            return []
        if self.tool_work == 0.0:       # nothing but its own motion: it lands, and nothing throws it back
            return [f"penalty and landing points take {100 * share:.1f} % of the energy that the body brings, as where it "
                    f"lands without rebound; if it should deform instead: {remedy}"]
        return [f"penalty and landing points take {100 * share:.1f} % of the tool power: {remedy}"]

    def summary(self) -> dict:
        last, mean = self.penalty_shares()
        return {"last_mW": self.last, "worst_relative_imbalance": self.worst,
                "penalty_share": {"last": last, "mean": mean}}
