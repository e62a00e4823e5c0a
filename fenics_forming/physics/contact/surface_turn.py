r"""Where surfaces that have turned have come to, and the frames in which their forces balance.

In small strains a part that goes round a drum moves by the linear :math:`u=c+\varphi\times x`, without strain.  That is no
circle: by :math:`\varphi^2/2` of its radius the part would leave the drum, and its forces balance as it lay at first.  So
the rigid motion in the displacement of a surface is found, by least squares, and taken for the motion with that constant
twist: a rotation :math:`R=e^{[\varphi]}` and the way :math:`Vc`,
:math:`V=I+\frac{1-\cos\varphi}{\varphi^2}[\varphi]+\frac{\varphi-\sin\varphi}{\varphi^3}[\varphi]^2`; what is left of the
displacement turns with it. By that each side has turned a little more or less, as in a belt that is stretched on a drum:
the forces on it balance in a frame of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..nodes import Nodes
from ..parallel import highest, total

SMALL = 1e-4        # radian, below which the series of the coefficients is exact
BENT = 0.05         # of the displacements: where less is not of the rigid motion, loads have tilted the sides, which counts
                    # the less; where more is, one end has slid farther than the other
STILL = 3e-4        # radian: a surface that loads have tilted by less lies as it is, as small strains have it


@dataclass(frozen=True)
class Turned:
    """Where a surface has come to.

    Attributes
    ----------
    x : (nodes, dim) mm, of the nodes of the surface; those of others mean nothing
    rotation : (sides of this rank, dim, dim) of the frames in which forces on them balance
    bent : part of the greatest displacement that is not of the rigid motion, 0 where it has not turned · most : that, mm
    """

    x: np.ndarray
    rotation: np.ndarray
    bent: float
    most: float


def turned_with(nodes: Nodes, sides: np.ndarray, displacement: np.ndarray) -> Turned:
    """Where displacements (nodes, dim), mm, bring a surface with some ``sides`` of this rank. Collective."""
    dim, used = nodes.dim, sides.ravel()
    x, u = np.zeros((2, nodes.count, 3))
    x[:, :dim], u[:, :dim] = nodes.x, displacement
    sums = total(nodes.comm, np.array([*x[used].sum(axis=0), len(used)]))
    arm = x - sums[:3] / max(sums[3], 1.0)
    turns = _crosses(np.eye(3) if dim == 3 else np.eye(3)[2:])      # in the plane about its normal
    modes = np.concatenate([np.broadcast_to(np.eye(3)[:dim], (len(used), dim, 3)),
                            np.einsum("kij,nj->nki", turns, arm[used])], axis=1)
    both = total(nodes.comm, np.einsum("nki,nli->kl", modes, np.concatenate([modes, u[used][:, None]], axis=1)))
    found = np.linalg.lstsq(both[:, :-1], both[:, -1], rcond=1e-12)[0]
    if np.linalg.norm(found[dim:]) < STILL:
        return Turned(nodes.x + displacement, np.broadcast_to(np.eye(dim), (len(sides), dim, dim)), 0.0, 0.0)
    along, spin = np.zeros(3), np.einsum("k,kij->ij", found[dim:], turns)
    along[:dim] = found[:dim]
    rotation, way = _exponential(spin)
    left = u - along - arm @ spin.T
    moved = x + way @ along + (arm + left) @ rotation.T - arm
    rest, whole = (highest(nodes.comm, float(np.linalg.norm(way[used], axis=1).max(initial=0.0))) for way in (left, u))
    bent = rest / whole
    own = min(bent / BENT, 1.0) * _own_spins(x[sides], left[sides], turns)
    of_sides = rotation @ _exponential(np.einsum("fk,kij->fij", own, turns))[0]
    return Turned(moved[:, :dim], of_sides[:, :dim, :dim], bent, whole)


def _own_spins(x: np.ndarray, u: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """How far displacements u turn the sides themselves, nodes at x (sides, n, 3): radian about each axis, (sides, k)."""
    modes = np.einsum("kij,fnj->fkni", turns, x - x.mean(axis=1, keepdims=True))
    both, right = np.einsum("fkni,flni->fkl", modes, modes), np.einsum("fkni,fni->fk", modes, u)
    return np.linalg.solve(both, right[..., None])[..., 0]


def _crosses(vectors: np.ndarray) -> np.ndarray:
    """Vectors (k, 3) as matrices (k, 3, 3) that take the vector product with them."""
    return np.stack([np.cross(vector, np.eye(3)).T for vector in vectors])


def _exponential(spin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R and V of skew matrices (..., 3, 3)."""
    angle = np.sqrt(0.5 * (spin**2).sum(axis=(-2, -1)))[..., None, None]
    small, a = angle < SMALL, np.maximum(angle, SMALL)
    one = np.where(small, 1 - angle**2 / 6, np.sin(a) / a)
    two = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(a)) / a**2)
    three = np.where(small, 1 / 6 - angle**2 / 120, (a - np.sin(a)) / a**3)
    square = spin @ spin
    return np.eye(3) + one * spin + two * square, np.eye(3) + two * spin + three * square
