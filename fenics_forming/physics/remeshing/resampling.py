"""New sides along the boundary of a plane body, of the wanted lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .curve import Curve

LARGEST_TURN = np.radians(45.0)    # of one side: a parabola follows that, and the cells behind it stay valid
GROWTH = 0.3                       # of the size, per distance
SMALLEST = 0.1                     # of the wanted size: curvature and thin walls refine no further
NEAR = 6.0                         # two walls bound a thin part where the way around is so much longer than across


@dataclass(frozen=True)
class Outline:
    """A boundary of new sides.

    Attributes
    ----------
    points : (n, 2) vertices, mm
    sides : (n, 2) the vertices of each side, body on the left
    middles : (n, 2) mid-nodes of the sides, mm
    labels : (n,)
    """

    points: np.ndarray
    sides: np.ndarray
    middles: np.ndarray
    labels: np.ndarray

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


def resample(loops: list[list[Curve]], sizes, chord: float | None, finer: float = 1.0) -> Outline:
    """New vertices and mid-nodes on the curves of each loop.

    The length h of the sides at a point of the boundary is the least of the wanted size, √(8 δ/κ) with the chord
    distance δ and the curvature κ, 45°/κ, the distance to the wall across a thin part, and the length of the run
    between two features; it grows by at most 0.3 per distance. A run has one side at least.
    """
    wanted = _wanted(loops, sizes, chord)
    parts, first = [], 0
    for loop, h in zip(loops, wanted, strict=True):
        least = -(-3 // len(loop))         # a loop is a triangle at least
        points, middles, labels = [], [], []
        for curve, own in zip(loop, np.split(h, np.cumsum([len(c.s) for c in loop])[:-1]), strict=True):
            s = curve.divide(own / finer, least)
            points.append(curve.at(s)[:-1])
            middles.append(curve.at(0.5 * (s[1:] + s[:-1])))
            labels.append(np.full(len(s) - 1, curve.label))
        points = np.concatenate(points)
        number = np.arange(len(points))
        parts.append((points, np.stack([number, np.roll(number, -1)], axis=1) + first, np.concatenate(middles),
                      np.concatenate(labels)))
        first += len(points)
    return Outline(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _wanted(loops, sizes, chord) -> list[np.ndarray]:
    """Wanted length of the sides at the samples of each loop, mm."""
    way = [np.concatenate([[0.0], np.cumsum([c.length for c in loop])]) for loop in loops]
    s = [np.concatenate([c.s + at for c, at in zip(loop, w[:-1], strict=True)])
         for loop, w in zip(loops, way, strict=True)]
    points = np.concatenate([c.at(c.s) for loop in loops for c in loop])
    asked = np.asarray(sizes(points), dtype=float)
    curvature = np.concatenate([c.curvature() for loop in loops for c in loop])
    with np.errstate(divide="ignore"):
        h = LARGEST_TURN / curvature
        if chord is not None:
            h = np.minimum(h, np.sqrt(8.0 * chord / curvature))
    h = np.minimum(h, np.concatenate([np.full(len(c.s), c.length) for loop in loops for c in loop]))
    h = np.minimum(h, _thickness(loops, s, way, points, asked.max()))
    h = np.clip(h, SMALLEST * asked, asked)
    cuts = np.cumsum([len(part) for part in s])[:-1]
    return [_graded(part, own, float(w[-1])) for part, own, w in zip(s, np.split(h, cuts), way, strict=True)]


def _graded(s: np.ndarray, h: np.ndarray, length: float) -> np.ndarray:
    """The largest lengths below h that change by GROWTH per distance along a closed loop."""
    around = np.concatenate([s - length, s, s + length])
    h = np.tile(h, 3)
    up = np.minimum.accumulate(h - GROWTH * around) + GROWTH * around
    down = (np.minimum.accumulate((h + GROWTH * around)[::-1]) - GROWTH * around[::-1])[::-1]
    return np.minimum(up, down)[len(s):2 * len(s)]


def _thickness(loops, s, way, points, reach: float) -> np.ndarray:
    """Distance to the wall opposite, across the body, at the samples; infinite where it is far, mm."""
    inward = np.concatenate([c.tangents(c.s) for loop in loops for c in loop])[:, ::-1] * [-1.0, 1.0]
    loop = np.repeat(np.arange(len(loops)), [len(part) for part in s])
    along, around = np.concatenate(s), np.array([w[-1] for w in way])[loop]
    i, j = cKDTree(points[::2]).query_pairs(reach, output_type="ndarray").T * 2
    i, j = np.append(i, j), np.append(j, i)
    gap = points[j] - points[i]
    distance = np.linalg.norm(gap, axis=1)
    apart = np.abs(along[j] - along[i])
    apart = np.where(loop[i] == loop[j], np.minimum(apart, around[i] - apart), np.inf)
    across = ((apart > NEAR * distance) & ((gap * inward[i]).sum(axis=1) > 0.7 * distance)
              & ((inward[i] * inward[j]).sum(axis=1) < -0.7))
    thickness = np.full(len(points), np.inf)
    np.minimum.at(thickness, i[across], distance[across])
    return thickness
