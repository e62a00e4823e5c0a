"""A chain of parabolas as one smooth curve by arc length, and new sides along it.

New parabolas through points of the old ones would keep every small kink between those and, remeshing after
remeshing, cut its tip off. A cubic spline through the old vertices and mid-nodes has none: the new sides leave it by
the third derivative only, and lose a volume of fourth order in their length.
"""

from __future__ import annotations

import numpy as np

from ...errors import MeshError
from .outline import Chain, angle_between
from .spline import Spline, half_lengths

STRAIGHT = 1e-9          # of the length: what rounding leaves of a straight run
SAMPLES = 4              # of the wanted size, on each half of an old side
UNEVEN = 1e-6            # of a side: round lengths ask for n + 1/2 sides, of which round-off must not decide
LEAST_AROUND = 4         # knots of a closed spline, the first again among them


class Curve:
    """A chain by arc length.

    Parameters
    ----------
    detail : function of points to what is too fine there to be followed, mm: of points that are closer to each other than
        a third of it only one is kept

    Attributes
    ----------
    length : mm
    nodes : (2 k + 1,) numbers of its old nodes in the body
    s : (k,) arc lengths of its samples, the ends included
    """

    def __init__(self, chain: Chain, detail=None):
        self.label, self.nodes = chain.label, chain.nodes
        self._knots = np.concatenate([[0.0], np.cumsum(half_lengths(chain.points))])
        self.length = float(self._knots[-1])
        if not (np.diff(self._knots) > 0.0).all():
            place = ", ".join(f"{c:.6g}" for c in chain.points[np.argmin(np.diff(self._knots))])
            raise MeshError(f"a boundary side at ({place}) mm has no length")
        self._ends = chain.points[[0, -1]]
        self._spline = None if _straight(chain.points, self.length) else _spline(chain, self._knots, detail)
        fractions = np.arange(SAMPLES) / SAMPLES
        self.s = np.append((self._knots[:-1, None] + np.diff(self._knots)[:, None] * fractions).ravel(), self.length)

    def at(self, s: np.ndarray) -> np.ndarray:
        """Points at arc lengths, (k, 2)."""
        if self._spline is None:
            a, b = self._ends
            return a + (b - a) * (s / self.length)[:, None]
        points, _ = self._spline(s)
        points[s == 0.0], points[s == self.length] = self._ends
        return points

    def tangents(self, s: np.ndarray) -> np.ndarray:
        """Unit tangents, body on the left, (k, 2)."""
        if self._spline is None:
            return np.tile((self._ends[1] - self._ends[0]) / self.length, (len(s), 1))
        _, t = self._spline(s)
        return t / np.linalg.norm(t, axis=1)[:, None]

    def curvature(self) -> np.ndarray:
        """At the samples, 1/mm: the turn over the side before and the side after, so that kinks are spread."""
        if self._spline is None:
            return np.zeros(len(self.s))
        vertices = self._knots[::2]
        t = self.tangents(vertices)
        turn = np.concatenate([[0.0], np.cumsum(angle_between(t[:-1], t[1:]))])
        reach = np.diff(vertices)[np.clip(np.searchsorted(vertices, self.s, "right") - 1, 0, len(vertices) - 2)]
        low, high = np.maximum(self.s - reach / 2, 0.0), np.minimum(self.s + reach / 2, self.length)
        return np.abs(np.interp(high, vertices, turn) - np.interp(low, vertices, turn)) / (high - low)

    def interpolate(self, nodal: np.ndarray) -> np.ndarray:
        """Values at the samples from those at the vertices of the old body: (n,) in, of which its own count."""
        return np.interp(self.s, self._knots[::2], nodal[self.nodes[::2]])

    def divide(self, h: np.ndarray, least: int) -> np.ndarray:
        """Arc lengths of the vertices of new sides, (n + 1,): as many as the wanted lengths h at the samples ask."""
        density = 0.5 * (1 / h[1:] + 1 / h[:-1]) * np.diff(self.s)
        number = np.concatenate([[0.0], np.cumsum(density)])
        n = max(least, int(np.floor(number[-1] + 0.5 + UNEVEN)))
        s = np.interp(np.linspace(0.0, number[-1], n + 1), number, self.s)
        s[0], s[-1] = 0.0, self.length
        return s


def _spline(chain: Chain, knots: np.ndarray, detail) -> Spline:
    """Through the points of a chain that are not too close to each other."""
    kept = np.arange(len(knots)) if detail is None else _spread(knots, detail(chain.points) / 3)
    if chain.closed and len(kept) < LEAST_AROUND:
        kept = np.arange(len(knots))
    return Spline(knots[kept], chain.points[kept], chain.closed)


def _spread(knots: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Numbers of the knots, both ends among them, that are about ``apart`` (k,) from the one before, or more."""
    number = np.concatenate([[0.0], np.cumsum(np.diff(knots) * 2 / (apart[1:] + apart[:-1]))])
    if np.diff(number).min() >= 1.0:
        return np.arange(len(knots))
    _, first = np.unique(np.floor(number), return_index=True)
    return np.append(first[(first == 0) | (number[first] < number[-1] - 0.5)], len(knots) - 1)


def _straight(points: np.ndarray, length: float) -> bool:
    """All points on the way from the first to the last, and in turn."""
    way = points[-1] - points[0]
    chord = np.linalg.norm(way)
    if length - chord > STRAIGHT * length:
        return False
    off = (points[:, 0] - points[0, 0]) * way[1] - (points[:, 1] - points[0, 1]) * way[0]
    return bool(np.abs(off).max() <= STRAIGHT * chord**2)
