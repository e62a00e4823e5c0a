"""The folds of a run: where and when the surface of the body met itself, each told once."""

from __future__ import annotations

import numpy as np

from ...process.folding import FoldFinder

EVERY = 5        # steps between two searches
SAME = 0.1       # of the size of the body: a fold so near to where one was found last is that one, moved on


class FoldRecord:
    """What was found of folds so far.

    Attributes
    ----------
    folds : step, place (mm) and depth_mm of every fold, as first found; the depth is the greatest so far
    """

    def __init__(self):
        self.folds: list[dict] = []
        self._now: list[np.ndarray] = []        # where each was found last
        self._finders: list[FoldFinder] = []
        self._looked, self._told = 0, 0

    def look(self, body, step: int, *, now: bool = False) -> None:
        """Search the surface of ``body`` every few steps, or ``now`` unless this step was searched before. Collective."""
        if step == self._looked or not (now or step % EVERY == 0):
            return
        self._looked = step
        of_bodies = body.skins()
        if [finder.free for finder in self._finders] != [free for free, _ in of_bodies]:
            self._finders = [FoldFinder(free, cells) for free, cells in of_bodies]
        for finder in self._finders:
            found = finder.find(body.x)
            for place, depth in zip(found.places, found.depths, strict=True):
                self._add(step, place, float(depth), SAME * body.size)

    def _add(self, step: int, place: np.ndarray, depth: float, near: float) -> None:
        away = [float(np.linalg.norm(place - other)) for other in self._now]
        if away and min(away) < near:
            fold = int(np.argmin(away))
            self.folds[fold]["depth_mm"] = max(self.folds[fold]["depth_mm"], depth)
            self._now[fold] = place
            return
        self.folds.append({"step": step, "place": [float(c) for c in place], "depth_mm": depth})
        self._now.append(place)

    def news(self) -> list[str]:
        """A sentence for every fold that has not been told yet."""
        new, self._told = self.folds[self._told:], len(self.folds)
        return [_sentence(fold) for fold in new]

    def doubts(self) -> list[str]:
        """A sentence for every fold."""
        return [_sentence(fold) for fold in self.folds]

    def memory(self) -> dict:
        """What a run that is resumed must know."""
        return {"folds": self.folds, "now": [[float(c) for c in place] for place in self._now]}

    def remember(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        self.folds, self._now = [dict(fold) for fold in memory["folds"]], [np.array(place) for place in memory["now"]]
        self._told = len(self.folds)


def _sentence(fold: dict) -> str:
    place = ", ".join(f"{c:.4g}" for c in fold["place"])
    return f"the surface folds onto itself at ({place}), step {fold['step']}; self-contact is not modelled"
