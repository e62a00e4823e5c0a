r"""The surface of a body of order 2: what it encloses, how that changes with its nodes, normals at the nodes.

The volume is found from the surface alone, by the divergence theorem: plane strain :math:`\frac12\oint(x\,dy-y\,dx)`,
axisymmetric :math:`\pi\oint r^2dz`, else :math:`\frac13\oint x\cdot n\,dA`.  The maps of the sides are quadratic, the
integrands polynomials and the quadrature exact for them: it is the volume of the curved cells themselves.
"""

from __future__ import annotations

from functools import cache

import basix
import numpy as np
from mpi4py import MPI

from .facets import exterior_facets
from .kinematics import Kinematics
from .locating import by_coordinate
from .machine_code import compiled
from .nodes import EDGES, Nodes, determinants, quadratic_shapes
from .parallel import total

# vertices of the facets of a cell whose Jacobian is positive: body on the left (2-D), normal outwards (3-D)
FACETS = {2: ((1, 2), (2, 0), (0, 1)), 3: ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))}
FOOT_STEPS = 6
FOUND = 1e-13   # of a side: a step so small is the last
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
        self._element, self._weights, self._shape, self._gradient, self._gradient_at_nodes = _tables(self.dim)
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
        if self.dim == 2:
            axisymmetric = self.kinematics.name == "axisymmetric"
            return total(self.comm, enclosed(x, self.sides, self._shape, self._gradient[0], self._weights, self._middle,
                                             axisymmetric))
        p = x[self.sides]
        at, normal = np.matmul(self._shape, p) - self._middle, self._area_vectors(self._gradient, p)
        flux = np.einsum("fqi,fqi->fq", at, normal) / 3
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

    def lengths(self, x: np.ndarray) -> np.ndarray:
        """Length of every side, of a facet the edge of an equal triangle with equal sides, (f,), mm."""
        size = self.sizes(x)
        return size if self.dim == 2 else np.sqrt(size * 4 / np.sqrt(3))

    def centres(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Middle of every side, (f, dim) mm, and the outward unit normal there, (f, dim)."""
        at, tangents = self._at(np.full((len(self.sides), self.dim), 1.0 / self.dim), x[self.sides])
        normal = _across(np.moveaxis(tangents, 1, 0))
        return at, normal / _lengths(normal)[:, None]

    def foot(self, p: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the perpendicular from each point (k, dim) meets the side beside it, with nodes ``p`` (k, 3 | 6, dim).

        Returns
        -------
        (k, dim) foot, (k, dim) outward unit normal there, (k,) whether it lies within the side
        """
        inner = np.full((len(p), self.dim), 1.0 / self.dim)
        for _ in range(FOOT_STEPS):
            at, tangents = self._at(inner, p)
            metric = np.matmul(tangents, np.swapaxes(tangents, 1, 2))
            metric += 1e-12 * np.trace(metric, axis1=1, axis2=2)[:, None, None] * np.eye(self.dim - 1)
            along = np.einsum("kti,ki->kt", tangents, points - at)
            step = np.clip(np.linalg.solve(metric, along[..., None])[..., 0], -1.0, 1.0)
            inner[:, 1:] += step
            inner[:, 0] -= step.sum(axis=1)
            if np.abs(step).max(initial=0.0) < FOUND:
                break
        at, tangents = self._at(inner, p)
        normal = _across(np.moveaxis(tangents, 1, 0))
        return at, normal / _lengths(normal)[:, None], (inner > -1e-6).all(axis=1)

    def _at(self, inner: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (k, dim) at barycentric coordinates of the sides p, and the tangents there (k, dim - 1, dim)."""
        slope = by_coordinate(inner, p)
        return np.einsum("ka,kai->ki", quadratic_shapes(inner, self.dim - 1), p), slope[:, 1:] - slope[:, :1]

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

    def numbering(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the nodes that all ranks share, (count,), and which of them this rank owns, (count,)."""
        if self._nodes is None:
            return np.arange(count), np.ones(count, bool)
        nodes = self._nodes.mesh.geometry.index_map()
        return nodes.local_to_global(np.arange(count, dtype=np.int32)), np.arange(count) < nodes.size_local

    def summed(self, nodal: np.ndarray) -> np.ndarray:
        """The contributions of all ranks at their common nodes together: (n[, k]) in, the same out. Collective."""
        return nodal if self._nodes is None else self._nodes.sum_at_all(nodal)

    def _area_vectors(self, gradient: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Outward normals, as long as the surface is stretched, at points of the sides p (f, nodes, dim)."""
        return _across([np.matmul(g, p) for g in gradient])


@compiled
def enclosed(x, sides, shape, gradient, weights, middle, axisymmetric):
    """Area, or volume of revolution, between sides (sides, 3) in the plane with nodes at ``x``, of shapes and slopes
    (points, 3) and weights (points,); lengths are counted from the ``middle`` (2,)."""
    out = 0.0
    for f in range(len(sides)):
        for q in range(len(weights)):
            at = up = across = along = 0.0
            for a in range(sides.shape[1]):
                node = sides[f, a]
                at += shape[q, a] * x[node, 0]
                up += shape[q, a] * x[node, 1]
                across += gradient[q, a] * x[node, 1]
                along -= gradient[q, a] * x[node, 0]
            if axisymmetric:
                out += np.pi * at * at * across * weights[q]
            else:
                out += 0.5 * ((at - middle[0]) * across + (up - middle[1]) * along) * weights[q]
    return out


@cache
def _tables(dim: int):
    """The quadratic element on a side; weights of the quadrature, shapes and slopes at its points; slopes at the nodes."""
    cell = {2: basix.CellType.interval, 3: basix.CellType.triangle}[dim]
    element = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
    points, weights = basix.make_quadrature(cell, DEGREE[dim])
    table = element.tabulate(1, points)[..., 0]
    return element, weights, table[0], table[1:], element.tabulate(1, element.points)[1:, :, :, 0]


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
    table = np.array([[*f, *(mid[frozenset((f[a], f[b]))] for a, b in EDGES[dim - 1])] for f in FACETS[dim]])
    p = x[cells[:, : dim + 1]]
    nodes = table[facet]
    mirrored = determinants(p[:, 1:] - p[:, :1]) < 0
    # exchanging the first two vertices turns a facet over; in 3-D the mid-nodes opposite to them go along
    nodes[mirrored] = nodes[mirrored][:, {2: [1, 0, 2], 3: [1, 0, 2, 4, 3, 5]}[dim]]
    return np.take_along_axis(cells, nodes, axis=1)


def _across(tangents) -> np.ndarray:
    """The vector across the tangents (dim - 1 arrays (..., dim)) of a side, outwards, as long as it is stretched."""
    if len(tangents) == 1:
        return np.stack([tangents[0][..., 1], -tangents[0][..., 0]], axis=-1)
    return np.cross(tangents[0], tangents[1])


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """Lengths of vectors (..., dim), 1 for those that vanish."""
    length = np.linalg.norm(vectors, axis=-1)
    return np.where(length > 0, length, 1.0)
