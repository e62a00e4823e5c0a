"""Heat: what was made, where it went, and what does not balance."""

from __future__ import annotations

MOST_OPEN = 1e-8     # of the heat that a step moves; what is more is no rounding


class HeatLedger:
    """Heat of a run by cause, mJ (mJ/mm in plane strain), summed over its steps.

    Parameters
    ----------
    copies : parts of the whole body that the mesh stands for
    """

    def __init__(self, copies: int):
        self._copies = copies
        self.sums: dict[str, float] = {}
        self.worst = 0.0
        self.cut_pairs = 0

    def memory(self) -> dict:
        """What a later run goes on from, as JSON can hold it."""
        return {"sums": self.sums, "worst": self.worst, "cut_pairs": self.cut_pairs}

    def remember(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        self.sums, self.worst, self.cut_pairs = dict(memory["sums"]), memory["worst"], memory["cut_pairs"]

    def book(self, state) -> None:
        """Add what a step has moved (``heating.HeatState``)."""
        for name, heat in {**{f"by_{n}": h for n, h in state.made.items()},
                           **{f"to_{n}": h for n, h in state.lost.items()},
                           **{f"through_{n}": h for n, h in state.through.items()}}.items():
            self.sums[name] = self.sums.get(name, 0.0) + heat * self._copies
        self.worst = max(self.worst, abs(state.imbalance))
        self.cut_pairs = max(self.cut_pairs, state.cut_pairs)

    def row(self, state, unit: str) -> dict[str, float]:
        """Columns of the history: the hottest place of tools, sums so far in J, and the imbalance of the last step."""
        sums = {f"heat_{name.replace('.', '_').replace('-', '_')}_{unit}": heat / 1000 for name, heat in self.sums.items()}
        hottest = {f"max_temperature_{name}_degC": value for name, value in state.hottest.items()}
        return hottest | sums | {"heat_imbalance": state.imbalance}

    def doubts(self) -> list[str]:
        """A sentence where heat was lost or made by the computation itself."""
        if self.worst <= MOST_OPEN:
            return []
        return [f"the heat of a step does not balance by {self.worst:.1e} of what it moves"]

    def summary(self) -> dict:
        return {"sums_mJ": self.sums, "worst_relative_imbalance": self.worst, "most_pairs_cut": self.cut_pairs}
