r"""Forces of contact carried from the points of a workpiece to the nodes of a tool: not one newton is lost.

A point :math:`x_q` that carries the force f is captured by a facet of the tool, with its foot :math:`x_c`.  The nodes of
the facet get :math:`N_a(x_c)\,f`, which does the same work on every displacement of the tool as f does at the foot; and
the couple :math:`(x_q-x_c)\times f` of the distance between both meshes as the forces of a small turn of the facet, so
that forces and moments are the same to round-off.  Without the couple 1e-4 of the moment would be lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..contact.capture import CapturingSurface
from ..nodes import Nodes
from ..surface import facet_sides


@dataclass(frozen=True)
class ContactForces:
    """Forces of a workpiece on a tool at single points, as the tool's own frame sees them.

    points : (k, dim) mm · forces : (k, dim) N, N/mm in plane strain, of the full turn in axisymmetry
    """

    points: np.ndarray
    forces: np.ndarray

    def total(self) -> np.ndarray:
        """Their sum, (dim,)."""
        return self.forces.sum(axis=0)

    def moment(self, about=0.0) -> np.ndarray:
        """Their moment about a point, (3,) in space and (1,) in the plane, N mm."""
        return moments(self.points - about, self.forces).sum(axis=0)


def moments(arms: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Moments of forces (k, dim) at arms (k, dim): (k, 1) in the plane, (k, 3) in space."""
    if arms.shape[1] == 2:
        return (arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0])[:, None]
    return np.cross(arms, forces)


def carried(acting: ContactForces, nodes: Nodes, surface: np.ndarray, *, with_couples: bool = True) -> np.ndarray:
    """Nodal forces, (nodes, dim) N, of forces that all ranks give alike. Collective.

    Parameters
    ----------
    surface : (f,) owned exterior facets of this rank that may carry them
    with_couples : also the couples of the distance of points and feet; in axisymmetry there are none
    """
    sides = facet_sides(nodes, surface)
    numbers = np.asarray(nodes.mesh.geometry.index_map().local_to_global(sides.ravel().astype(np.int32)))
    counts = nodes.comm.allgather(len(sides))
    x = np.concatenate(nodes.comm.allgather(nodes.x[sides]))
    found = CapturingSurface(x, np.concatenate(nodes.comm.allgather(numbers.reshape(sides.shape)))).capture(acting.points)
    first = sum(counts[: nodes.comm.rank])
    mine = (found.facet >= first) & (found.facet < first + len(sides))
    at, facet = sides[found.facet[mine] - first], x[found.facet[mine]]
    shapes, forces = found.shapes[mine], acting.forces[mine]
    shares = shapes[..., None] * forces[:, None]
    if with_couples:
        foot = np.einsum("pa,pai->pi", shapes, facet)
        shares += _turning(facet, moments(acting.points[mine] - foot, forces))
    columns = [np.bincount(at.ravel(), shares[..., i].ravel(), nodes.count) for i in range(nodes.dim)]
    return nodes.sum_at_all(np.stack(columns, axis=1))


def _turning(x: np.ndarray, couples: np.ndarray) -> np.ndarray:
    """Forces at the nodes (p, a, dim) of facets whose sum is zero and whose moment is the couple (p, 1 | 3)."""
    arms = x - x.mean(axis=1, keepdims=True)
    if x.shape[2] == 2:
        turned = np.stack([-arms[..., 1], arms[..., 0]], axis=-1)
        return couples[:, None] * turned / (arms**2).sum(axis=(1, 2))[:, None, None]
    square = np.einsum("pai,paj->pij", arms, arms)
    inertia = np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3) - square
    rate = np.linalg.solve(inertia, couples[..., None])[..., 0]
    return np.cross(rate[:, None], arms)
