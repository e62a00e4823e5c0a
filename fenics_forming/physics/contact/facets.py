"""The contact facets of a body: points, weights and traces at the integration points, and the facet integrals.

The traction and its tangent live in quadrature functions on the submesh of the contact facets and enter an ordinary
UFL facet integral over the body; so the contact law may be any vectorised function of the points.
"""

from __future__ import annotations

from functools import cached_property
from itertools import permutations

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from ..facets import mean_lengths
from ..kinematics import Kinematics
from ..machine_code import compiled
from ..nodes import Nodes
from ..parallel import total

DEGREE = {2: 6, 3: 4}   # 4 points per side, 6 per triangle: more than the bulk needs
TAG = 1
ALIKE = 1e-9            # normals that differ by less are the same


class ContactFacets:
    """Integration points on the facets of a body that a tool may touch.

    Parameters
    ----------
    nodes : the nodes of the body
    kinematics : geometry kind (weights: 2 pi r in axisymmetry)
    facets : (n,) owned exterior facets of the mesh

    Attributes
    ----------
    facet_nodes : (facets, nodes per facet), the vertices first
    hats : linear shape functions of a facet's vertices at its points, (points per facet, dim)
    shape : the quadratic ones of all its nodes, (points per facet, nodes per facet)
    count : number of points on this rank
    """

    def __init__(self, nodes: Nodes, kinematics: Kinematics, facets: np.ndarray):
        mesh, dim = nodes.mesh, nodes.dim
        self._nodes, self._kinematics, self.dim = nodes, kinematics, dim
        self._sub, parent, _, node_map = dmesh.create_submesh(mesh, dim - 1, np.sort(facets).astype(np.int32))
        facet_map = mesh.topology.index_map(dim - 1)
        inverse = np.full(facet_map.size_local + facet_map.num_ghosts, -1, dtype=np.int32)
        inverse[parent] = np.arange(len(parent))
        self.entity_maps = {self._sub: inverse}
        self._node_map = node_map
        count = self._sub.topology.index_map(dim - 1).size_local
        self.facet_nodes = np.asarray(node_map)[self._sub.geometry.dofmap[:count]].astype(np.int32)

        cell = self._sub.basix_cell()
        degree = DEGREE[dim]
        points, self._reference_weights = basix.make_quadrature(cell, degree)
        element = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
        table = element.tabulate(1, points)[:, :, :, 0]
        self.shape, self._gradient = table[0], table[1:]
        self.hats = basix.create_element(basix.ElementFamily.P, cell, 1).tabulate(0, points)[0, :, :, 0]
        w = self._reference_weights
        self._projection = self.hats @ np.linalg.solve(self.hats.T @ (w[:, None] * self.hats), self.hats.T * w)
        self.points_per_facet = len(points)
        self.count = count * self.points_per_facet
        self.measure = ufl.Measure("ds", domain=mesh, subdomain_data=_tags(mesh, dim - 1, parent[:count]))(TAG)

    def _at_points(self, shape: tuple[int, ...], name: str) -> fem.Function:
        """A function of the points, for forms."""
        element = basix.ufl.quadrature_element(self._sub.basix_cell().name, value_shape=shape, degree=DEGREE[self.dim])
        return fem.Function(fem.functionspace(self._sub, element), name=name)

    @cached_property
    def traction_function(self) -> fem.Function:
        """Traction of the contact in the facet integrals, N/mm²."""
        return self._at_points((self.dim,), "contact_traction")

    @cached_property
    def tangent_function(self) -> fem.Function:
        """Its negative derivative by the velocity, N s/mm³."""
        return self._at_points((self.dim, self.dim), "contact_tangent")

    @property
    def comm(self):
        return self._nodes.comm

    @property
    def axisymmetric(self) -> bool:
        return self._kinematics.name == "axisymmetric"

    # ------------------------------------------------------------------ terms
    def virtual_power(self, w, weight):
        r"""Power of the contact traction, :math:`-\int t\cdot w\,d\Gamma`, mW (mJ/s)."""
        return -ufl.inner(self.traction_function, w) * weight * self.measure

    def tangent(self, dv, w, weight):
        r"""Its derivative, :math:`\int w\cdot T\,dv\,d\Gamma` with :math:`T=-\partial t/\partial v`."""
        return ufl.inner(ufl.dot(self.tangent_function, dv), w) * weight * self.measure

    def set_traction(self, traction: np.ndarray, tangent: np.ndarray) -> None:
        """Write traction (points, dim) and tangent (points, dim, dim) into the facet integrals."""
        self.traction_function.x.array[: traction.size] = traction.ravel()
        self.tangent_function.x.array[: tangent.size] = tangent.ravel()

    def weighted_tangent(self, weights: np.ndarray | None = None) -> np.ndarray:
        """The tangents that are set, each times the surface of its point, (facets, points per facet, dim · dim); with the
        :meth:`weights` of the present geometry, where they are known."""
        size, weights = self.count * self.dim**2, self.weights() if weights is None else weights
        values = self.tangent_function.x.array[:size].reshape(self.count, -1) * weights[:, None]
        return values.reshape(-1, self.points_per_facet, self.dim**2)

    def nodal_forces(self, traction: np.ndarray) -> np.ndarray:
        """Forces of tractions at the points (points, dim) on the nodes, (nodes, dim), N, of the facets of this rank."""
        weighted = (traction * self.weights()[:, None]).reshape(-1, self.points_per_facet, self.dim)
        at, shares = self.facet_nodes.ravel(), np.matmul(self.shape.T, weighted).reshape(-1, self.dim)
        return np.stack([np.bincount(at, shares[:, i], self._nodes.count) for i in range(self.dim)], axis=1)

    # ------------------------------------------------------------------ geometry and traces
    def follow(self) -> None:
        """Take over the positions of the body: the submesh has a geometry of its own."""
        self._sub.geometry.x[:] = self._nodes.mesh.geometry.x[self._node_map]

    def size(self) -> float:
        """Mean length of a side of the contact facets, mm."""
        lengths = mean_lengths(self._nodes.x[self.facet_nodes[:, : self.dim]])
        sums = total(self._nodes.comm, np.array([lengths.sum(), len(lengths)]))
        return float(sums[0] / max(sums[1], 1.0))

    def trace(self, nodal: np.ndarray) -> np.ndarray:
        """Values at the integration points of a nodal field (nodes[, k]) → (points[, k])."""
        columns = np.ascontiguousarray(nodal, float).reshape(len(nodal), -1)
        return at_points(columns, self.facet_nodes, self.shape).reshape((self.count, *nodal.shape[1:]))

    def weights(self, points: np.ndarray | None = None) -> np.ndarray:
        """Surface of the body that belongs to each point, mm² (mm in plane strain), (points,); at ``points``, where they
        are known."""
        points = self.trace(self._nodes.x) if points is None else points
        if self.dim == 2:
            surface = side_lengths(self._nodes.x, self.facet_nodes, self._gradient[0], self._reference_weights)
        else:
            surface = (np.linalg.norm(self.area_vectors(), axis=-1) * self._reference_weights).ravel()
        return surface * self._kinematics.weight_at(points)

    def area_vectors(self) -> np.ndarray:
        """Vectors across the facets at their points, as long as the surface is stretched there, (facets, points per
        facet, dim); of either sense."""
        tangents = np.einsum("kqa,fad->kfqd", self._gradient, self._nodes.x[self.facet_nodes])
        if self.dim == 2:
            return np.stack([tangents[0][..., 1], -tangents[0][..., 0]], axis=-1)
        return np.cross(tangents[0], tangents[1])

    def to_nodes(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Hat-weighted mean at the vertices of values at the points, (points,) → (nodes,); 0 off the contact."""
        count, shape = self._nodes.count, (-1, self.points_per_facet)
        sums = hat_sums(self.facet_nodes, weights.reshape(shape), values.reshape(shape), self.hats, count)
        sums = self._nodes.sum_over_ranks(sums)
        return np.divide(sums[:, 0], sums[:, 1], out=np.zeros(count), where=sums[:, 1] > 0)

    def loaded_to_nodes(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """The same means over the facets alone that carry something: on the rim of a platen that of the face under it,
        where a mean with the free side beside it would be half of that."""
        loaded = (values.reshape(-1, self.points_per_facet) != 0).any(axis=1)
        return self.to_nodes(values, weights * np.repeat(loaded, self.points_per_facet))

    def smooth(self, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Values at the points replaced by the interpolation of their nodal means."""
        nodal = self.to_nodes(values, weights)
        return (nodal[self.facet_nodes[:, : self.dim]] @ self.hats.T).ravel()

    def linear_part(self, values: np.ndarray) -> np.ndarray:
        """Least-squares linear part, facet by facet, of values at the points: what a quadratic velocity can balance."""
        return (values.reshape(-1, self.points_per_facet) @ self._projection.T).ravel()

    def staying(self, closed: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Which of the points that were ``closed``, (points,) bool, stay so for the first guess of the next solve, with the
        ``normals`` of a tool (points, dim) there.

        Sides that have moved over a curved tool hover between their nodes, and points there would open that press on. In
        the plane those alone: on flat ground only a side that rolls hovers.
        """
        if self.dim == 3:
            return closed
        along = normals.reshape(-1, self.points_per_facet, self.dim)
        turns = (np.abs(along - along[:, :1]) > ALIKE).any(axis=(1, 2))
        return closed & np.repeat(turns, self.points_per_facet)

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Sum over the points of all ranks of values that carry their weight already: (points[, k]) → ([k])."""
        return total(self._nodes.comm, values.sum(axis=0))

    def points_from(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The facets as seen from their vertices in rising order of ``rows`` (nodes,), whichever way they are stored.

        Returns
        -------
        (facets, dim) rows of the vertices, rising; (facets, points per facet) the local number of every point
        """
        return seen_from_vertices(rows[self.facet_nodes[:, : self.dim]], self.hats)


@compiled
def at_points(nodal, groups, shape):
    """Values of a nodal field (nodes, k) at the points of groups (groups, nodes of one), by the shape functions (points,
    nodes of one): (groups, points, k)."""
    out = np.zeros((len(groups), len(shape), nodal.shape[1]))
    for f in range(len(groups)):
        for q in range(len(shape)):
            for a in range(shape.shape[1]):
                for i in range(nodal.shape[1]):
                    out[f, q, i] += shape[q, a] * nodal[groups[f, a], i]
    return out


@compiled
def side_lengths(x, sides, gradient, weights):
    """Length of the sides (sides, 3) in the plane that belongs to their points of reference gradients (points, 3) and
    weights (points,): (sides · points,)."""
    out = np.empty((len(sides), len(weights)))
    for f in range(len(sides)):
        for q in range(len(weights)):
            along = up = 0.0
            for a in range(sides.shape[1]):
                along += gradient[q, a] * x[sides[f, a], 0]
                up += gradient[q, a] * x[sides[f, a], 1]
            out[f, q] = np.sqrt(along * along + up * up) * weights[q]
    return out.ravel()


@compiled
def hat_sums(facets, weights, values, hats, count):
    """Per node the sums over the facets' points of their weights (facets, points) times the hats (points, vertices), with
    ``values`` (facets, points) and without: (count, 2)."""
    out = np.zeros((count, 2))
    for f in range(len(facets)):
        for a in range(hats.shape[1]):
            row = out[facets[f, a]]
            for q in range(len(hats)):
                share = weights[f, q] * hats[q, a]
                row[0] += share * values[f, q]
                row[1] += share
    return out


def seen_from_vertices(corners: np.ndarray, hats: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points of facets with numbered vertices ``corners`` (f, dim) as seen from these in rising order: those numbers,
    rising, and the local number of every point, (f, points); ``hats`` (points, dim) are the points' coordinates."""
    order = np.argsort(corners, axis=1)
    seen = {way: [int(np.argmin(((hats[:, way] - place) ** 2).sum(axis=1))) for place in hats]
            for way in permutations(range(hats.shape[1]))}
    points = np.array([seen[tuple(way)] for way in order.tolist()], dtype=int).reshape(-1, len(hats))
    return np.take_along_axis(corners, order, axis=1), points


def _tags(mesh, dim: int, facets: np.ndarray):
    return dmesh.meshtags(mesh, dim, facets, np.full(len(facets), TAG, dtype=np.int32))
