r"""The surface of a body of order 2: what it encloses, how that changes with its nodes, normals at the nodes.

The volume is found from the surface alone, by the divergence theorem: plane strain :math:`\frac12\oint(x\,dy-y\,dx)`,
axisymmetric :math:`\pi\oint r^2dz`, else :math:`\frac13\oint x\cdot n\,dA`.  The maps of the sides are quadratic, the
integrands polynomials and the quadrature exact for them: it is the volume of the curved cells themselves.
"""

from __future__ import annotations

import basix
import numpy as np
from mpi4py import MPI

from .kinematics import Kinematics
from .meshing import exterior_facets
from .nodes import EDGES, Nodes
from .parallel import total

# vertices of the facets of a cell whose Jacobian is positive: body on the left (2-D), normal outwards (3-D)
FACETS = {2: ((1, 2), (2, 0), (0, 1)), 3: ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))}
DEGREE = {2: 5, 3: 4}      # of r² dz and of x · n dA on a quadratic side


class Surface:
    """The sides of a body of order 2, of which every rank has its own.

    Parameters
    ----------
    sides : (f, 3 | 6) nodes of the boundary facets: vertices (2-D: body on the left; 3-D: around the outward normal),
        then mid-nodes (3-D: opposite to the first, second, third vertex)
    x : (n, dim) positions of the nodes, mm
    kinematics : geometry kind
    nodes : of the mesh on all ranks; without them the whole body is on this rank
    """

    def __init__(self, sides: np.ndarray, x: np.ndarray, kinematics: Kinematics, *, nodes: Nodes | None = None):
        self.sides, self.kinematics, self.dim = sides, kinematics, x.shape[1]
        self.comm = MPI.COMM_SELF if nodes is None else nodes.comm
        self._nodes = nodes
        cell = {2: basix.CellType.interval, 3: basix.CellType.triangle}[self.dim]
        element = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
        points, self._weights = basix.make_quadrature(cell, DEGREE[self.dim])
        self._element = element
        table = element.tabulate(1, points)[..., 0]
        self._shape, self._gradient = table[0], table[1:]
        self._gradient_at_nodes = element.tabulate(1, element.points)[1:, :, :, 0]
        middle = x[sides].sum(axis=(0, 1))
        sums = total(self.comm, np.append(middle, sides.size))
        self._middle = sums[:-1] / sums[-1]     # lengths are counted from here: no digits are lost far from the origin

    @classmethod
    def of(cls, nodes: Nodes, kinematics: Kinematics) -> Surface:
        """The surface of a mesh; every rank has the exterior facets that it owns."""
        return cls(facet_sides(nodes, exterior_facets(nodes.mesh)), nodes.x, kinematics, nodes=nodes)

    # ------------------------------------------------------------------ volume
    def volume(self, x: np.ndarray) -> float:
        """Volume enclosed when the nodes are at ``x`` (n, dim), mm³ (mm² in plane strain). Collective."""
        p = x[self.sides]
        at, normal = np.matmul(self._shape, p) - self._middle, self._area_vectors(self._gradient, p)
        if self.kinematics.name == "axisymmetric":
            flux = np.pi * (at[..., 0] + self._middle[0]) ** 2 * normal[..., 0]
        else:
            flux = np.einsum("fqi,fqi->fq", at, normal) / self.dim
        return float(total(self.comm, (flux @ self._weights).sum()))

    def volume_rate(self, x: np.ndarray, motion: np.ndarray) -> float:
        r"""Derivative of the volume as the nodes move by ``motion`` (n, dim), exactly :math:`\oint motion\cdot n\,dA`."""
        p = x[self.sides]
        speed = np.matmul(self._shape, motion[self.sides])
        flux = np.einsum("fqi,fqi->fq", speed, self._area_vectors(self._gradient, p))
        if self.kinematics.name == "axisymmetric":
            flux *= 2 * np.pi * np.matmul(self._shape, p[..., 0:1])[..., 0]
        return float(total(self.comm, (flux @ self._weights).sum()))

    # ------------------------------------------------------------------ geometry
    def sizes(self, x: np.ndarray) -> np.ndarray:
        """Length (mm) or area (mm²) of every side, (f,)."""
        return np.linalg.norm(self._area_vectors(self._gradient, x[self.sides]), axis=-1) @ self._weights

    def points_of(self, x: np.ndarray, local: np.ndarray) -> np.ndarray:
        """Points of every side at the ``local`` coordinates (p, dim - 1): (f, p, dim)."""
        return np.matmul(self._element.tabulate(0, local)[0, :, :, 0], x[self.sides])

    def normals(self, x: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Outward unit normals at the nodes of the ``chosen`` (f,) sides, each side weighing with its size, and the mean
        cosine between them and those of the sides: 1 where the surface is smooth; both zero elsewhere: (n, dim), (n,).
        Collective.
        """
        sides, size = self.sides[chosen], self.sizes(x)[chosen, None]
        vectors = self._area_vectors(self._gradient_at_nodes, x[sides])
        weight = np.broadcast_to(size, sides.shape)
        vectors *= (weight / _lengths(vectors))[..., None]
        columns = [vectors[..., k] for k in range(self.dim)] + [weight]
        sums = self.summed(np.stack([np.bincount(sides.ravel(), c.ravel(), len(x)) for c in columns], axis=1))
        vectors, weight = sums[:, :-1], sums[:, -1]
        length = np.linalg.norm(vectors, axis=1)
        return vectors / _lengths(vectors)[:, None], length / np.where(weight > 0, weight, 1.0)

    def marked(self, chosen: np.ndarray, count: int) -> np.ndarray:
        """Whether a node lies on one of the ``chosen`` sides of any rank, (count,). Collective."""
        return self.summed(np.bincount(self.sides[chosen].ravel(), minlength=count).astype(float)) > 0

    def summed(self, nodal: np.ndarray) -> np.ndarray:
        """The contributions of all ranks at their common nodes together: (n[, k]) in, the same out. Collective."""
        return nodal if self._nodes is None else self._nodes.sum_at_all(nodal)

    def _area_vectors(self, gradient: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Outward normals, as long as the surface is stretched, at points of the sides p (f, nodes, dim)."""
        tangents = [np.matmul(g, p) for g in gradient]
        if self.dim == 2:
            return np.stack([tangents[0][..., 1], -tangents[0][..., 0]], axis=-1)
        return np.cross(tangents[0], tangents[1])


def facet_sides(nodes: Nodes, facets: np.ndarray) -> np.ndarray:
    """Nodes of exterior facets of a mesh, (f, 3 | 6), turned as `Surface` wants them."""
    mesh, dim = nodes.mesh, nodes.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    mesh.topology.create_connectivity(dim, dim - 1)
    to_cell, to_facet = mesh.topology.connectivity(dim - 1, dim), mesh.topology.connectivity(dim, dim - 1)
    cell = to_cell.array[to_cell.offsets[facets]]
    local = np.argmax(to_facet.array.reshape(-1, dim + 1)[cell] == np.asarray(facets)[:, None], axis=1)
    return sides_of(mesh.geometry.dofmap[cell], local, nodes.x)


def sides_of(cells: np.ndarray, facet: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Nodes of one facet (f,) of each of the cells (f, 6 | 10), basix order, turned as `Surface` wants them."""
    dim = x.shape[1]
    mid = {frozenset(e): dim + 1 + i for i, e in enumerate(EDGES[dim])}
    own = EDGES[2] if dim == 3 else ((0, 1),)
    table = np.array([[*f, *(mid[frozenset((f[a], f[b]))] for a, b in own)] for f in FACETS[dim]])
    p = x[cells[:, : dim + 1]]
    nodes = table[facet]
    mirrored = np.linalg.det(p[:, 1:] - p[:, :1]) < 0
    # exchanging the first two vertices turns a facet over; in 3-D the mid-nodes opposite to them go along
    nodes[mirrored] = nodes[mirrored][:, {2: [1, 0, 2], 3: [1, 0, 2, 4, 3, 5]}[dim]]
    return np.take_along_axis(cells, nodes, axis=1)


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """Lengths of vectors (..., dim), 1 for those that vanish."""
    length = np.linalg.norm(vectors, axis=-1)
    return np.where(length > 0, length, 1.0)
