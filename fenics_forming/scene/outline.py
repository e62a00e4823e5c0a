"""Plane outlines, open or closed, without a mesh: area, crossings, rounded corners, what lies inside."""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Line:
    """A straight piece of an outline; points in mm."""

    start: tuple[float, float]
    end: tuple[float, float]

    def sampled(self, count):
        """`count` + 1 points from start to end, shape (count + 1, 2)."""
        s = np.linspace(0, 1, count + 1)[:, None]
        return (1 - s) * np.array(self.start) + s * np.array(self.end)


@dataclass(frozen=True)
class Arc:
    """A circular piece of an outline; `turn` is the angle from start to end, rad, positive to the left."""

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float]
    radius: float
    turn: float

    def sampled(self, count):
        """`count` + 1 points from start to end, shape (count + 1, 2)."""
        first = math.atan2(self.start[1] - self.centre[1], self.start[0] - self.centre[0])
        angles = first + np.linspace(0, self.turn, count + 1)
        return np.array(self.centre) + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])


def signed_area(points):
    """Area of a closed polygon by the shoelace formula, mm^2; positive when counter-clockwise."""
    x, y = np.transpose(points)
    x, y = x - x[0], y - y[0]
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def crossing_sides(points, *, closed):
    """The first pair of sides (numbers of their first points) that meet away from a common corner, or None."""
    points = np.asarray(points, dtype=float)
    starts = points if closed else points[:-1]
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    count = len(starts)
    for i in range(count):
        others = np.arange(i + 1, count)
        meet = _meet(starts[i], ends[i], starts[others], ends[others])
        neighbours = (others == i + 1) | (closed & (i == 0) & (others == count - 1))
        meet[neighbours] = [_folds_back(starts, ends, i, j) for j in others[neighbours]]
        if meet.any():
            return i, int(others[meet.argmax()])
    return None


def corner_turns(points, *, closed):
    """Change of direction at every point, rad, positive to the left; 0 at the ends of an open outline."""
    points = np.asarray(points, dtype=float)
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    turns = np.arctan2(_cross(before, after), np.sum(before * after, axis=1))
    if not closed:
        turns[[0, -1]] = 0.0
    return turns


def rounded_pieces(points, radii, *, closed):
    """Lines and arcs of an outline whose corners are rounded with the given radii (0: sharp).

    A corner that turns by the angle phi loses the length radius * tan(phi / 2) on both sides.

    Raises
    ------
    ValueError, with the number of the corner, if a rounding does not fit between its neighbours.
    """
    points = np.asarray(points, dtype=float)
    turns = corner_turns(points, closed=closed)
    cut = np.array(radii) * np.tan(np.abs(turns) / 2)
    count = len(points)
    sides = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    pieces = []
    for i in range(count if closed else count - 1):
        j = (i + 1) % count
        if cut[i] + cut[j] > sides[i] * (1 + 1e-9):
            raise ValueError(i if cut[i] > cut[j] else j)
        along = (points[j] - points[i]) / sides[i]
        start, end = points[i] + cut[i] * along, points[j] - cut[j] * along
        if sides[i] - cut[i] - cut[j] > 1e-9 * sides[i]:
            pieces.append(Line(_pair(start), _pair(end)))
        if cut[j] > 0:
            pieces.append(_arc(points[j], end, along, radii[j], turns[j], cut[j]))
    return pieces


def rounding_area(turn, radius):
    """Area that rounding a corner takes away on its inner side, mm^2: r^2 (tan(phi/2) - phi/2)."""
    phi = abs(turn)
    return radius**2 * (math.tan(phi / 2) - phi / 2)


def polygonal(pieces, *, per_turn=72):
    """The outline as a polygon: ends of lines and points on arcs, `per_turn` for a full circle, shape (n, 2)."""
    chains = [
        piece.sampled(1 if isinstance(piece, Line) else max(2, math.ceil(per_turn * abs(piece.turn) / math.tau)))[:-1]
        for piece in pieces
    ]
    return np.vstack([*chains, [pieces[-1].end]])


def is_inside(points, polygon):
    """Whether points lie inside a closed polygon (ray casting); shape (n,) of bool. The boundary is either."""
    points, polygon = np.atleast_2d(points), np.asarray(polygon, dtype=float)
    inside = np.zeros(len(points), dtype=bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        straddles = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
        if not straddles.any():
            continue
        x = a[0] + (points[:, 1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) if b[1] != a[1] else np.inf
        inside ^= straddles & (points[:, 0] < x)
    return inside


def nearest(points, polygon, *, closed):
    """Distance to the nearest side, mm, and whether the point lies to the left of that side; shapes (n,).

    At a corner the side is taken whose line is farther from the point, which decides left and right correctly.
    """
    points, polygon = np.atleast_2d(points), np.asarray(polygon, dtype=float)
    ends = np.roll(polygon, -1, axis=0) if closed else polygon[1:]
    best = np.full(len(points), np.inf)
    height = np.zeros(len(points))
    for a, b in zip(polygon if closed else polygon[:-1], ends, strict=True):
        along, offset = b - a, points - a
        length = np.hypot(*along)
        if length == 0:         # between two fillets that take all of a side
            continue
        share = np.clip(offset @ along / length**2, 0, 1)
        distance = np.hypot(*(offset - share[:, None] * along).T)
        to_the_left = (along[0] * offset[:, 1] - along[1] * offset[:, 0]) / length
        same = np.abs(distance - best) <= 1e-12 * (1 + length)
        better = (distance < best) & ~same | same & (np.abs(to_the_left) > np.abs(height))
        best, height = np.where(better, distance, best), np.where(better, to_the_left, height)
    return best, height > 0


def _arc(corner, start, along, radius, turn, cut):
    left = np.array([-along[1], along[0]]) * math.copysign(1, turn)
    out = np.array(
        [
            along[0] * math.cos(turn) - along[1] * math.sin(turn),
            along[0] * math.sin(turn) + along[1] * math.cos(turn),
        ]
    )
    return Arc(_pair(start), _pair(corner + cut * out), _pair(start + radius * left), float(radius), float(turn))


def _pair(point):
    return float(point[0]), float(point[1])


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _folds_back(starts, ends, i, j):
    if not np.array_equal(ends[i], starts[j]):
        i, j = j, i
    before, after = ends[i] - starts[i], ends[j] - starts[j]
    size = np.hypot(*before) * np.hypot(*after)
    return abs(_cross(before, after)) <= 1e-12 * size and before @ after < 0


def _meet(a, b, c, d):
    """Whether the closed segment ab has a point in common with segments cd, bool, shape (n,)."""
    ab, cd = b - a, d - c
    slack = 1e-12 * (np.hypot(*ab) + np.hypot(*cd.T)) ** 2
    sides = (_cross(ab, c - a), _cross(ab, d - a), _cross(cd, a - c), _cross(cd, b - c))
    c_side, d_side, a_side, b_side = (np.where(np.abs(side) <= slack, 0, np.sign(side)) for side in sides)
    cross = (c_side * d_side < 0) & (a_side * b_side < 0)
    touch = (c_side == 0) & _between(c, a, b) | (d_side == 0) & _between(d, a, b)
    return cross | touch | (a_side == 0) & _between(a, c, d) | (b_side == 0) & _between(b, c, d)


def _between(point, a, b):
    slack = 1e-12 * (1 + np.abs(b - a).max(axis=-1, keepdims=True))
    return np.all((point >= np.minimum(a, b) - slack) & (point <= np.maximum(a, b) + slack), axis=-1)
