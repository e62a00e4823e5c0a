"""Segments and circular arcs that a profile in the plane is made of, and the exact gap to them."""

from dataclasses import dataclass, fields

import numpy as np

from fenics_forming.errors import SceneError

STRAIGHT = 1e-9     # a vertex that turns less, in radian, gets no fillet


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of a profile in walking order, one per row; lengths in mm, tool on the right."""

    start: np.ndarray           # (m, 2)
    end: np.ndarray             # (m, 2)
    start_normal: np.ndarray    # (m, 2) mean normal of the pieces that meet there; decides the sign
    end_normal: np.ndarray      # (m, 2)
    normal: np.ndarray          # (m, 2) left-hand unit normal; of an arc, that at its middle
    centre: np.ndarray          # (m, 2) of an arc
    radius: np.ndarray          # (m,) 0 for a segment
    middle: np.ndarray          # (m, 2) unit vector from the centre to the middle of an arc
    cos_half: np.ndarray        # (m,) cosine of half the angle of an arc
    angle: np.ndarray           # (m,) of an arc, positive for a left turn
    beyond: np.ndarray          # (m, 2, 2) where a profile ends at the start or end of a piece, its direction there; else 0

    @classmethod
    def of(cls, points, fillet, closed):
        """Sides shortened by the fillets, and the fillets, of a profile with vertices (n, 2).

        A fillet of radius R at a turn by the angle a cuts R tan(a/2) off both sides.
        """
        n, sides = len(points), len(points) - (not closed)
        step = np.roll(points, -1, axis=0) - points
        length = np.linalg.norm(step, axis=1)
        along = (step / length[:, None])[:sides]
        normals = np.stack([-along[:, 1], along[:, 0]], axis=1)
        # side before and side behind each vertex; an open end has one side only
        before = np.roll(np.arange(n), 1) if closed else np.maximum(np.arange(n) - 1, 0)
        behind = np.minimum(np.arange(n), sides - 1)
        mean = normals[before] + normals[behind]
        mean /= np.linalg.norm(mean, axis=1)[:, None]

        turns = turns_of(points, closed)
        fillet = np.broadcast_to(np.asarray(fillet, float), n)
        rounded = (np.abs(turns) > STRAIGHT) & (fillet > 0)
        cut = np.where(rounded, fillet * np.tan(np.abs(turns) / 2), 0.0)
        left = (length - cut - np.roll(cut, -1))[:sides]
        tiny = 1e-12 * np.ptp(points, axis=0).max()
        if left.min() < -tiny:
            _refuse_fillet(fillet.max(), points, np.argmin(left), length, cut)
        arc_start, arc_end = points - cut[:, None] * along[before], points + cut[:, None] * along[behind]

        first, last = np.arange(sides), (np.arange(sides) + 1) % n
        vertex_normal = np.where(rounded[:, None], np.nan, mean)
        none, zero = np.zeros((sides, 2)), np.zeros(sides)
        beyond = np.zeros((sides, 2, 2))
        if not closed:
            beyond[0, 0], beyond[-1, 1] = -along[0], along[-1]
        segments = cls(arc_end[first], arc_start[last], _first_finite(vertex_normal[first], normals),
                       _first_finite(vertex_normal[last], normals), normals, none, zero, none, zero, zero, beyond)
        # the centre of a left turn lies on the left
        side = np.sign(turns)[:, None]
        arcs = cls(arc_start, arc_end, normals[before], normals[behind], mean,
                   arc_start + side * fillet[:, None] * normals[before], fillet, -side * mean,
                   np.cos(turns / 2), turns, np.zeros((n, 2, 2)))
        sides, corners = np.flatnonzero(left > tiny), np.flatnonzero(rounded)
        walk = np.argsort(np.concatenate([2 * sides + 1, 2 * corners]))
        return cls(*(np.concatenate([s[sides], c[corners]])[walk]
                     for s, c in zip(segments._columns(), arcs._columns(), strict=True)))

    def take(self, rows):
        """The pieces with these numbers."""
        return Pieces(*(column[rows] for column in self._columns()))

    def length(self):
        """Length (m,) of every piece in mm."""
        return np.where(self.radius > 0, np.abs(self.angle) * self.radius,
                        np.linalg.norm(self.end - self.start, axis=1))

    def boxes(self):
        """Low and high corners (m, 2) of the boxes around the pieces."""
        ends = [self.start, self.end]
        for pole in np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]):
            reached = (self.radius > 0) & (self.middle @ pole >= self.cos_half)
            ends.append(np.where(reached[:, None], self.centre + self.radius[:, None] * pole, self.start))
        return np.min(ends, axis=0), np.max(ends, axis=0)

    def nearest(self, points):
        """Number (n,) of the piece nearest to each point, by looking at all of them."""
        nearest = np.empty(len(points), int)
        for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(self.radius) // 200_000):
            nearest[rows] = np.argmin(self._distance2(points[rows, None]), axis=1)
        return nearest

    def gap(self, points):
        """Signed gap (n,) and normal (n, 2) of points to as many pieces, one each."""
        straight, share = self.radius == 0, self._share(points)
        arm = points - self.centre
        distance = np.linalg.norm(arm, axis=1)
        on_arc = ~straight & self._in_sector(arm, distance)
        sense = -np.sign(self.angle)
        apart = distance > 0
        outward = np.where(apart[:, None], arm / np.where(apart, distance, 1.0)[:, None], self.middle)
        gap = np.where(on_arc, sense * (distance - self.radius), _dot(points - self.start, self.normal))
        normal = np.where(on_arc[:, None], sense[:, None] * outward, self.normal)

        at_end = np.where(straight, (share <= 0) | (share >= 1), ~on_arc)
        second = np.where(straight, share >= 1, _norm2(points - self.end) < _norm2(points - self.start))
        second = second[:, None]
        away = points - np.where(second, self.end, self.start)
        rule = np.where(second, self.end_normal, self.start_normal)
        inside = _dot(away, rule + np.where(second, self.beyond[:, 1], self.beyond[:, 0])) < 0
        signed = np.linalg.norm(away, axis=1) * np.where(inside, -1.0, 1.0)
        # nearer than this the direction away from the vertex is round-off
        close = np.abs(signed) <= 1e-9 * self._size()
        direction = np.where(close[:, None], rule, away / np.where(close, 1.0, signed)[:, None])
        return np.where(at_end, signed, gap), np.where(at_end[:, None], direction, normal)

    def _columns(self):
        return [getattr(self, column.name) for column in fields(self)]

    def _size(self):
        return np.linalg.norm(self.end - self.start, axis=1)

    def _share(self, points):
        """Place of the foot of the perpendicular on a segment: 0 at its start, 1 at its end."""
        step = self.end - self.start
        return _dot(points - self.start, step) / _norm2(step)

    def _in_sector(self, arm, distance):
        return _dot(arm, self.middle) >= self.cos_half * distance

    def _distance2(self, points):
        """Squared distance of points (n, 1, 2) to every piece (m,)."""
        share = np.clip(self._share(points), 0.0, 1.0)[..., None]
        to_segment = _norm2(points - self.start - share * (self.end - self.start))
        if not self.radius.any():
            return to_segment
        arm = points - self.centre
        distance = np.sqrt(_norm2(arm))
        to_end = np.minimum(_norm2(points - self.start), _norm2(points - self.end))
        to_arc = np.where(self._in_sector(arm, distance), (distance - self.radius) ** 2, to_end)
        return np.where(self.radius > 0, to_arc, to_segment)


def turns_of(points, closed):
    """Angle (n,) in radian by which a line turns to the left at each vertex; 0 at open ends."""
    step = np.roll(points, -1, axis=0) - points
    last = np.roll(step, 1, axis=0)
    turns = np.arctan2(last[:, 0] * step[:, 1] - last[:, 1] * step[:, 0], _dot(last, step))
    if not closed:
        turns[[0, -1]] = 0.0
    return turns


def _refuse_fillet(fillet, points, side, length, cut):
    most = fillet * length[side] / (cut[side] + np.roll(cut, -1)[side])
    a, b = points[side].tolist(), points[(side + 1) % len(points)].tolist()
    raise SceneError(f"is {fillet:g} mm; the side from {a} to {b} has room for at most {most:.6g} mm",
                     key="fillet", got=fillet, allowed=f"at most {most:.6g} mm")


def _first_finite(wanted, otherwise):
    return np.where(np.isnan(wanted), otherwise, wanted)


def _dot(a, b):
    return np.einsum("...k,...k->...", a, b)


def _norm2(a):
    return _dot(a, a)
