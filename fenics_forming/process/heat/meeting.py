"""Heat between several workpieces: where their surfaces meet, what goes over there, and the friction heat made there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...physics.contact.capture import CapturingSurface
from ...physics.parallel import total
from ...physics.thermal.pairing import conductances, dense_points, normals_of

CLOSED = 1e-2       # of the size of a side: how near the other body is where it touches; deeper than half of it is none
DEEPEST = 0.5
FACING = 0.7        # cosine between the normals of surfaces that touch, at least
PARTS = {2: 8, 3: 4}


@dataclass(frozen=True)
class Meeting:
    """Two bodies that may touch.

    Attributes
    ----------
    name : of their contact · slave, master : (f, 3 | 6) sides of this rank of the finer and of the other body
    bodies : names of both
    outwards : heat that goes from the first named body to the other counts positive: 1 if that is the slave, else -1
    coefficient : mJ/s/mm²/K, None where their common surface insulates · shares : of friction heat, of slave and master
    """

    name: str
    slave: np.ndarray
    master: np.ndarray
    bodies: tuple[str, str]
    outwards: float
    coefficient: float | None
    shares: tuple[float, float]


@dataclass(frozen=True)
class Joined:
    """Points at which bodies touch: vertices by their numbers of all ranks and hats, of slave and master, (p, dim) each,
    and the surface of each, (p,) mm²."""

    vertices: np.ndarray
    hats: np.ndarray
    opposite: np.ndarray
    opposite_hats: np.ndarray
    area: np.ndarray

    def pairs(self, coefficient: float) -> tuple[np.ndarray, np.ndarray]:
        """Pairs (m, 2) of a vertex of the slave and one of the master, and their conductances (m,), mW/K."""
        return conductances((self.vertices, self.hats), (self.opposite, self.opposite_hats), coefficient * self.area)


class Opposite:
    """The surface of a body, all of it on every rank, as others touch it. Making one is collective."""

    def __init__(self, field, sides: np.ndarray):
        nodes, everywhere = field.nodes, lambda rows: np.concatenate(field.nodes.comm.allgather(rows))
        self.dim = nodes.dim
        self._numbers, self._places = everywhere(field.vertex_numbers[sides]), everywhere(nodes.x[sides])
        self._surface = CapturingSurface(self._places, self._numbers)

    def touched(self, points: np.ndarray, normals: np.ndarray, size: np.ndarray):
        """Which points (k, dim) lie on it, with the normals (k, dim) and the ``size`` (k,) of their own sides: (k,) bool;
        the vertices (k, dim) by number below each, and their hats (k, dim)."""
        found = self._surface.capture(points, CLOSED * float(size.max(initial=0.0)))
        facing = np.abs(np.einsum("ki,ki->k", found.normal, normals)) > FACING
        away = points - np.einsum("ka,kai->ki", found.shapes, self._places[found.facet])
        beside = np.linalg.norm(away - np.where(np.isfinite(found.gap), found.gap, 0.0)[:, None] * found.normal, axis=1)
        on = facing & (beside <= CLOSED * size) & (found.gap <= CLOSED * size) & (found.gap >= -DEEPEST * size)
        vertices = self._numbers[found.facet][:, : self.dim]
        return on, vertices, hats_of(found.shapes, self.dim)


def hats_of(shapes: np.ndarray, dim: int) -> np.ndarray:
    """Linear functions of the vertices of sides (k, dim) from the quadratic ones of all nodes (k, 3 | 6)."""
    mids = shapes[:, dim:]
    if dim == 2:
        return shapes[:, :2] + 0.5 * mids
    return shapes[:, :3] + 0.5 * (mids.sum(axis=1, keepdims=True) - mids)      # mid-nodes lie opposite to their vertex


def joined(field, meeting: Meeting) -> Joined:
    """Where two bodies touch as they lie now, on rank 0 the points of all ranks. Collective."""
    nodes, sides = field.nodes, meeting.slave
    x = nodes.x[sides]
    places, area, hats = dense_points(x, PARTS[nodes.dim])
    count = places.shape[1]
    side = np.repeat(np.arange(len(sides)), count)
    length = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    points = places.reshape(-1, nodes.dim)
    on, below, below_hats = Opposite(field, meeting.master).touched(points, normals_of(x)[side], length[side])
    weight = np.broadcast_to(field.kinematics.weight_at(points), len(points))
    own = field.vertex_numbers[sides[:, : nodes.dim]][side]
    rows = [own[on], np.tile(hats, (len(sides), 1))[on], below[on], below_hats[on], (area.ravel() * weight)[on]]
    parts = [nodes.comm.gather(values, 0) for values in rows]
    return Joined(*rows) if parts[0] is None else Joined(*(np.concatenate(part) for part in parts))


def friction_heat_between(field, meeting: Meeting, contact, power: np.ndarray) -> np.ndarray:
    """Friction heat of two bodies, each its share, to the nodes (nodes,), K/s. Collective.

    contact : the ``BodyContact`` of both · power : (carriers,) mW/mm² of the present flow
    """
    nodes, points = field.nodes, contact.points
    at_corners = contact.carriers.at_corners(power)
    density = np.einsum("qk,fk->fq", points.basis, at_corners).ravel()
    spread = np.where(np.isfinite(contact.point_gap), density * contact.point_weights, 0.0)
    sums = total(nodes.comm, np.array([power @ contact.weights, spread.sum()]))
    spread *= sums[0] / sums[1] if sums[1] > 0 else 0.0
    own = np.repeat(field.vertex_numbers[points.sides[:, : nodes.dim]], points.per_side, axis=0)
    own_hats = np.tile(hats_of(points.shape, nodes.dim), (len(points.sides), 1))
    opposite, shapes = contact.opposite(field.vertex_numbers)
    given = np.zeros(field.vertex_count)
    for share, vertices, hats in zip(meeting.shares, (own, opposite), (own_hats, hats_of(shapes, nodes.dim)), strict=True):
        given += np.bincount(vertices.ravel(), (share * spread[:, None] * hats).ravel(), len(given))
    return field.heating(total(nodes.comm, given)[field.vertex_numbers])
