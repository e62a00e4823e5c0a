"""Ledgers: what must balance in every step, and by how much it did not."""

from __future__ import annotations


class VolumeLedger:
    """Volume against that of the start; a rigid-plastic body keeps it."""

    def __init__(self, start: float):
        self.start, self.last, self.worst = start, 0.0, 0.0

    def error(self, volume: float) -> float:
        """Relative change of volume since the start."""
        self.last = volume / self.start - 1.0
        self.worst = max(self.worst, abs(self.last))
        return self.last

    def summary(self) -> dict:
        return {"relative_error": self.last, "worst_relative_error": self.worst, "by": {"integration": self.last}}


class PowerLedger:
    """Power given by the tools against plastic, friction, penalty and body-force power, relative to the first."""

    def __init__(self):
        self.last: dict[str, float] = {}
        self.worst = 0.0

    def imbalance(self, body) -> float:
        """Imbalance of the present flow of ``body``, relative to the power of the tools; 0 where nothing flows."""
        if body.workpiece.is_cold:
            return 0.0
        self.last = body.powers()
        given = self.last["tools"] + self.last["body force"]
        spent = self.last["plastic"] + self.last["friction"] + self.last["penalty"]
        scale = max(abs(given), abs(spent))
        relative = (given - spent) / scale if scale > 0 else 0.0
        self.worst = max(self.worst, abs(relative))
        return relative

    def summary(self) -> dict:
        return {"last_mW": self.last, "worst_relative_imbalance": self.worst}
