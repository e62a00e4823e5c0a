"""The nearest of points in the plane, by square bins: among some hundred cells of a section in a fifth of a tree's time."""

from __future__ import annotations

import numpy as np

from .machine_code import compiled

EACH = 2        # points in a bin, on average


class Bins:
    """Points of the plane, (n, 2), sorted into square bins."""

    def __init__(self, points: np.ndarray):
        self._points = np.ascontiguousarray(points, float)
        self._low, extent = self._points.min(axis=0), np.ptp(self._points, axis=0)
        self._width = max(np.sqrt(EACH * extent.prod() / len(points)), EACH * extent.max() / len(points)) or 1.0
        self._counts = (extent / self._width).astype(np.int64) + 1
        self._starts, self._order = sorted_into(self._points, self._low, self._width, self._counts)

    def query(self, points: np.ndarray, count: int = 1) -> np.ndarray:
        """Numbers of the nearest points to each of the given ones (p, 2), the nearest first: (p, count)."""
        return nearest(points, count, self._points, self._low, self._width, self._counts, self._starts, self._order)


@compiled
def bin_of(at, low, width, count):
    """Number along one axis of the bin of a coordinate, of the outermost one beyond them."""
    return min(max(int(np.floor((at - low) / width)), 0), count - 1)


@compiled
def sorted_into(points, low, width, counts):
    """Points (n, 2) by bins: where each bin begins, (bins + 1,), among the numbers of the points, (n,)."""
    bins, starts = np.empty(len(points), np.int64), np.zeros(counts[0] * counts[1] + 1, np.int64)
    for p in range(len(points)):
        bins[p] = bin_of(points[p, 0], low[0], width, counts[0]) * counts[1] \
            + bin_of(points[p, 1], low[1], width, counts[1])
        starts[bins[p] + 1] += 1
    starts = np.cumsum(starts)
    filled, order = starts[:-1].copy(), np.empty(len(points), np.int64)
    for p in range(len(points)):
        order[filled[bins[p]]] = p
        filled[bins[p]] += 1
    return starts, order


@compiled
def nearest(asked, count, points, low, width, counts, starts, order):
    """The nearest ``count`` of the binned points to each of the asked ones (p, 2), in rings of bins around it until no
    nearer ones can follow: (p, count), the nearest first and of equally near ones the one with the least number."""
    found, squares = np.zeros((len(asked), count), np.int64), np.empty(count)
    for p in range(len(asked)):
        x, y = asked[p, 0], asked[p, 1]
        i, j = bin_of(x, low[0], width, counts[0]), bin_of(y, low[1], width, counts[1])
        squares[:], ring = np.inf, 0
        while True:
            for a in range(max(i - ring, 0), min(i + ring, counts[0] - 1) + 1):
                step = 1 if abs(a - i) == ring else 2 * ring      # in between only the two bins at the ends are new
                for b in range(j - ring, j + ring + 1, max(step, 1)):
                    if 0 <= b < counts[1]:
                        for n in order[starts[a * counts[1] + b]:starts[a * counts[1] + b + 1]]:
                            insert(n, (points[n, 0] - x) ** 2 + (points[n, 1] - y) ** 2, found[p], squares)
            # to the sides of the square that has been searched, where bins lie behind them
            beyond = np.inf
            if i - ring > 0:
                beyond = min(beyond, x - low[0] - (i - ring) * width)
            if i + ring < counts[0] - 1:
                beyond = min(beyond, low[0] + (i + ring + 1) * width - x)
            if j - ring > 0:
                beyond = min(beyond, y - low[1] - (j - ring) * width)
            if j + ring < counts[1] - 1:
                beyond = min(beyond, low[1] + (j + ring + 1) * width - y)
            if beyond == np.inf or (beyond > 0.0 and beyond**2 > squares[-1]):
                break
            ring += 1
    return found


@compiled
def insert(number, square, numbers, squares):
    """Put a point at its place among the nearest so far, (count,) numbers and squares of distances, if it is one."""
    k = len(squares)
    while k > 0 and (square < squares[k - 1] or (square == squares[k - 1] and number < numbers[k - 1])):
        k -= 1
        if k + 1 < len(squares):
            squares[k + 1], numbers[k + 1] = squares[k], numbers[k]
        squares[k], numbers[k] = square, number
