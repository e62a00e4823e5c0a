"""New sides along the boundary of a plane body, of the wanted lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .boundary_kernels import nearest_walls
from .curve import Curve
from .gradation import around_loop

LARGEST_TURN = np.radians(45.0)    # of one side: a parabola follows that, and the cells behind it stay valid
# of the wanted size: what the shape of the body asks for beyond that is not done
SMALLEST = 0.35                    # where it turns or a run between two features is short
THINNEST = 0.1                     # where it is thin: cells of more than its thickness would be flat
NEAR = 6.0                         # two walls bound a thin part where the way around is so much longer than across


@dataclass(frozen=True)
class Outline:
    """A boundary of new sides.

    Attributes
    ----------
    points : (n, 2) vertices, mm
    sides : (n, 2) the vertices of each side, body on the left; those of a loop in turn
    middles : (n, 2) mid-nodes of the sides, mm
    labels : (n,)
    spans : (n, 2) arc lengths of the ends of each side along its loop, all loops one after the other, mm
    """

    points: np.ndarray
    sides: np.ndarray
    middles: np.ndarray
    labels: np.ndarray
    spans: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """Length of the boundary at the vertices, (n,): the mean of the two sides, mm."""
        length = np.linalg.norm(np.diff(self.points[self.sides], axis=1)[:, 0], axis=1)
        return 0.5 * sum(np.bincount(self.sides[:, k], length, len(self.points)) for k in range(2))

    @property
    def area(self) -> float:
        """Of the polygon, mm²."""
        (ax, ay), (bx, by) = self.points[self.sides[:, 0]].T, self.points[self.sides[:, 1]].T
        return 0.5 * float((ax * by - bx * ay).sum())


class Boundary:
    """The loops of curves of a body and the lengths of sides that are wanted along them.

    The length h of the sides at a point of the boundary is the least of the wanted size, √(8 δ/κ) with the chord
    distance δ and the curvature κ, 45°/κ, the distance to the wall across a thin part, and the length of the run
    between two features; it grows by at most 0.3 per distance.

    Parameters
    ----------
    sizes : callable, wanted sizes at points
    around : (n,) wanted size at the vertices of the old body, no larger than what is small near by allows
    least : curvature and short runs ask for no less, mm; None: for a share of the wanted size, the chord for any

    Attributes
    ----------
    h : (k,) wanted lengths at the samples of all curves in turn, mm
    """

    def __init__(self, loops: list[list[Curve]], sizes, around: np.ndarray, chord: float | None,
                 least: float | None = None):
        self.curves = [curve for loop in loops for curve in loop]
        self._loop = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])    # of each curve
        self._starts = np.concatenate([[0.0], np.cumsum([c.length for c in self.curves])])
        count = [len(c.s) for c in self.curves]
        self._cuts = np.cumsum(count)[:-1]
        self._loop_of_sample = np.repeat(self._loop, count)
        self._s = np.concatenate([c.s + at for c, at in zip(self.curves, self._starts, strict=False)])
        self._limits = self._starts[np.searchsorted(self._loop, np.arange(len(loops) + 1))]    # of the loops
        self.h = self._graded(self._wanted(sizes, around, chord, least))

    def resample(self) -> Outline:
        """New vertices and mid-nodes on the curves, one side on each at least."""
        least = -(-3 // np.bincount(self._loop))[self._loop]         # a loop is a triangle at least
        ways = [curve.divide(h, n) for curve, h, n in zip(self.curves, np.split(self.h, self._cuts), least, strict=True)]
        number = np.arange(sum(len(s) - 1 for s in ways))
        loop = np.repeat(self._loop, [len(s) - 1 for s in ways])
        following = number + 1
        first = np.searchsorted(loop, np.arange(loop[-1] + 1))
        following[np.append(first[1:], len(number)) - 1] = first
        return Outline(
            points=np.concatenate([c.at(s)[:-1] for c, s in zip(self.curves, ways, strict=True)]),
            sides=np.stack([number, following], axis=1),
            middles=np.concatenate([c.at(0.5 * (s[1:] + s[:-1])) for c, s in zip(self.curves, ways, strict=True)]),
            labels=np.concatenate([np.full(len(s) - 1, c.label) for c, s in zip(self.curves, ways, strict=True)]),
            spans=np.concatenate([np.stack([s[:-1], s[1:]], axis=1) + at
                                  for s, at in zip(ways, self._starts, strict=False)]))

    def refine(self, spans: np.ndarray | None = None) -> None:
        """Halve the lengths on some sides (their spans), or on all; changes ``h``."""
        inside = np.ones(len(self.h), dtype=bool)
        if spans is not None:
            spans = spans[np.argsort(spans[:, 0])]
            k = np.searchsorted(spans[:, 0], self._s, "right") - 1
            inside = (k >= 0) & (self._s <= spans[np.maximum(k, 0), 1])
        self.h = self._graded(np.where(inside, 0.5 * self.h, self.h))

    def _wanted(self, sizes, around, chord: float | None, least: float | None) -> np.ndarray:
        points = np.concatenate([c.at(c.s) for c in self.curves])
        asked = np.minimum(np.asarray(sizes(points), dtype=float),
                           np.concatenate([c.interpolate(around) for c in self.curves]))
        curvature = np.concatenate([c.curvature() for c in self.curves])
        length = np.concatenate([np.full(len(c.s), c.length) for c in self.curves])
        reach = min(float(asked.max()), 0.5 * float(np.ptp(points, axis=0).max()))
        floor = 0.0 if least is None else np.minimum(asked, least)
        with np.errstate(divide="ignore"):
            h = np.maximum(np.minimum(LARGEST_TURN / curvature, length), np.maximum(SMALLEST * asked, floor))
            h = np.minimum(h, np.maximum(self._thickness(points, reach), THINNEST * asked))
            if chord is not None:
                h = np.minimum(h, np.maximum(np.sqrt(8.0 * chord / curvature), floor))
        return np.minimum(h, asked)

    def _graded(self, h: np.ndarray) -> np.ndarray:
        """The same, growing along each loop at the rate of the sizes."""
        out = np.empty_like(h)
        for k, length in enumerate(np.diff(self._limits)):
            own = self._loop_of_sample == k
            out[own] = around_loop(h[own], self._s[own], length)
        return out

    def _thickness(self, points: np.ndarray, reach: float) -> np.ndarray:
        """Distance to the wall opposite, across the body, at the samples; infinite where it is far, mm."""
        inward = np.concatenate([c.tangents(c.s) for c in self.curves])[:, ::-1] * [-1.0, 1.0]
        thickness = np.full(len(points), np.inf)
        thickness[::2] = nearest_walls(points[::2], inward[::2].copy(), self._s[::2], self._loop_of_sample[::2],
                                       np.diff(self._limits), reach, NEAR)
        return thickness
