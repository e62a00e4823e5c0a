"""A mesh seen by its nodes: numpy views, volume-weighted averages at vertices, sums over all ranks.

The package keeps its meshes isoparametric of order 2, so the nodes of the geometry are the nodes of the velocity,
and everything that follows the material (positions, velocities, strains) is an array over the same nodes.
"""

from __future__ import annotations

import basix
import numpy as np
from dolfinx import fem, la
from dolfinx.mesh import Mesh

from . import compiling  # noqa: F401  before the first form or space is compiled
from .node_kernels import areas, fill_mids, least_jacobian, means_at_nodes, products, sums_at_vertices
from .parallel import highest, lowest

QUADRATURE_DEGREE = {2: 3, 3: 2}   # of the flow: 6 points a triangle, 4 a tetrahedron


class Nodes:
    """Arrays and reductions over the nodes of an order-2 mesh.

    Attributes
    ----------
    cells : (cells, nodes per cell) nodes of the owned cells; the vertices come first
    vertices : (cells, dim + 1) the same, vertices only
    count : number of nodes on this rank, ghosts included
    x : positions (count, dim), mm: a view, writing moves the mesh
    """

    def __init__(self, mesh: Mesh):
        self.mesh = mesh
        self.comm = mesh.comm
        self.dim = mesh.topology.dim
        if mesh.geometry.cmap.degree != 2:
            raise ValueError("the mesh must be isoparametric of order 2 (fenics_forming.physics.meshing.order_two)")
        owned = mesh.topology.index_map(self.dim).size_local
        self.cells = mesh.geometry.dofmap[:owned]
        self.vertices = self.cells[:, : self.dim + 1]
        self.x = mesh.geometry.x[:, : self.dim]
        self.count = len(self.x)
        self.scalar_space = fem.functionspace(mesh, ("Lagrange", 1))
        self.scalar_dofs = np.full(self.count, -1, dtype=np.int32)
        self.scalar_dofs[mesh.geometry.dofmap[:, : self.dim + 1].ravel()] = self.scalar_space.dofmap.list.ravel()
        self.is_vertex = self.scalar_dofs >= 0
        self._edge_mid, self._edge_ends = mid_nodes(mesh.geometry.dofmap, self.dim)
        cell = mesh.basix_cell()
        element = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
        points, _ = basix.make_quadrature(cell, QUADRATURE_DEGREE[self.dim])
        self._gradients = element.tabulate(1, points)[1:, :, :, 0]
        linear = np.column_stack([np.ones(len(points)), points])
        self._to_vertices = np.column_stack([np.ones(self.dim + 1), basix.geometry(cell)]) @ np.linalg.pinv(linear)
        p = self.x[self.vertices]
        self._orientation = np.sign(np.linalg.det(p[:, 1:] - p[:, :1])) if len(p) else np.empty(0)
        self._sums: dict[int, la.Vector] = {}

    def cell_sizes(self) -> np.ndarray:
        """Straight-sided area or volume of the owned cells, (cells,)."""
        if self.dim == 2:
            return areas(self.x, self.cells)
        p = self.x[self.vertices]
        return np.abs(determinants(p[:, 1:] - p[:, :1])) / 6.0

    def smallest_jacobian(self) -> float:
        """Smallest determinant of the cell maps at the integration points, mm² or mm³; negative: inverted."""
        if self.dim == 2:
            return least_jacobian(self.x, self.cells, self._gradients, self._orientation)
        oriented = determinants(self._local_gradients(self.x)) * self._orientation[:, None]
        return float(oriented.min()) if oriented.size else np.inf

    def sum_over_ranks(self, values: np.ndarray) -> np.ndarray:
        """Add the contributions of all ranks at shared vertices: (count,) or (count, k) in, the same out.

        Mid-nodes get the mean of the ends of their edge.
        """
        if self.comm.size == 1:
            return self.with_mids(values.copy())
        flat = values.reshape(self.count, -1)
        width = flat.shape[1]
        if width not in self._sums:
            self._sums[width] = la.vector(self.scalar_space.dofmap.index_map, width)
        vector = self._sums[width]
        array = vector.array.reshape(-1, width)
        array[:] = 0.0
        v = self.is_vertex
        array[self.scalar_dofs[v]] = flat[v]
        vector.scatter_reverse(la.InsertMode.add)
        vector.scatter_forward()
        out = np.empty_like(flat)
        out[v] = array[self.scalar_dofs[v]]
        return self.with_mids(out).reshape(values.shape)

    def sum_at_all(self, values: np.ndarray) -> np.ndarray:
        """Add the contributions of all ranks at shared nodes, mid-nodes too: (count[, k]) in, the same out."""
        if self.comm.size == 1:
            return values
        flat = values.reshape(self.count, -1)
        vector = la.vector(self.mesh.geometry.index_map(), flat.shape[1])
        vector.array[:] = flat.ravel()
        vector.scatter_reverse(la.InsertMode.add)
        vector.scatter_forward()
        return vector.array.reshape(values.shape).copy()

    def with_mids(self, nodal: np.ndarray) -> np.ndarray:
        """Fill the mid-nodes, in place, with the mean of the ends of their edge: (count[, k])."""
        if nodal.dtype == float and nodal.flags.c_contiguous:
            fill_mids(nodal.reshape(len(nodal), -1), self._edge_mid, self._edge_ends)
        else:
            nodal[self._edge_mid] = 0.5 * (nodal[self._edge_ends[:, 0]] + nodal[self._edge_ends[:, 1]])
        return nodal

    def edge_middles(self) -> tuple[np.ndarray, np.ndarray]:
        """Mid-nodes (k,) and ends (k, 2) of all edges of this rank, ghosts included."""
        return self._edge_mid, self._edge_ends

    def edges_at(self, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mid-nodes (k,) and ends (k, 2) of the edges of this rank, ghosts included, that meet in one of the vertices."""
        rows = np.isin(self._edge_ends, vertices).any(axis=1)
        return self._edge_mid[rows], self._edge_ends[rows]

    def vertex_mean(self, at_vertices: np.ndarray) -> np.ndarray:
        """Volume-weighted mean at the nodes of values given per cell and vertex, (cells, dim + 1[, k]).

        For a quantity that is linear in each cell, such as the rate of a quadratic velocity, evaluated at the
        vertices themselves this is second order also on the boundary.
        """
        width = int(np.prod(at_vertices.shape[2:]))
        flat = np.ascontiguousarray(at_vertices).reshape(len(self.cells), self.dim + 1, width)
        if self.comm.size == 1:
            mean = means_at_nodes(self.vertices, self.cell_sizes(), flat, self._edge_mid, self._edge_ends, self.count)
        else:
            sums = self.sum_over_ranks(sums_at_vertices(self.vertices, self.cell_sizes(), flat, self.count))
            mean = self.with_mids(sums[:, 1:] / sums[:, :1])
        return mean.reshape((self.count,) + at_vertices.shape[2:])

    def _local_gradients(self, nodal):
        """Derivatives of a nodal field (count, k) by the local coordinates: (cells, points, derivative, k)."""
        values = nodal[self.cells]
        table = self._gradients.reshape(-1, values.shape[1])
        by_local = np.matmul(table, values).reshape(len(values), self.dim, -1, values.shape[2])
        return np.moveaxis(by_local, 2, 1)

    def fit_to_vertices(self, at_points: np.ndarray) -> np.ndarray:
        """Values (cells, points, k) at the integration points, fitted linearly in each cell, at its vertices
        (cells, dim + 1, k): a curved cell may be singular there, what is linear in a straight one is met."""
        return products(self._to_vertices, np.ascontiguousarray(at_points))

    def gradient(self, nodal: np.ndarray) -> np.ndarray:
        """Gradient (count, k, dim) of a nodal field (count, k), 1/mm of its unit: volume-weighted mean at the nodes.

        Exact for linear fields, second order otherwise.
        """
        by_place = np.linalg.solve(self._local_gradients(self.x), self._local_gradients(nodal))
        corners = self.fit_to_vertices(by_place.reshape(by_place.shape[:2] + (-1,)))
        return np.swapaxes(self.vertex_mean(corners.reshape(corners.shape[:2] + by_place.shape[2:])), 1, 2)

    def extents(self) -> np.ndarray:
        """Lowest and highest coordinates of the body, (2, dim), mm."""
        return np.array([lowest(self.comm, self.x.min(axis=0, initial=np.inf)),
                         highest(self.comm, self.x.max(axis=0, initial=-np.inf))])


def determinants(tensors: np.ndarray) -> np.ndarray:
    """Determinants of (..., dim, dim); in the plane by the formula, ten times as fast as by factors."""
    if tensors.shape[-1] > 2:
        return np.linalg.det(tensors)
    return tensors[..., 0, 0] * tensors[..., 1, 1] - tensors[..., 0, 1] * tensors[..., 1, 0]


# vertices of the edges in basix order, which is that of the mid-nodes
EDGES = {1: ((0, 1),), 2: ((1, 2), (0, 2), (0, 1)), 3: ((2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))}


def mid_nodes(cells: np.ndarray, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Mid-nodes of all edges and the two vertices of each: (m,), (m, 2)."""
    mids = cells[:, dim + 1:].ravel()
    ends = np.stack([cells[:, list(e)] for e in EDGES[dim]], axis=1).reshape(-1, 2)
    first = np.full(int(mids.max(initial=-1)) + 1, -1)
    first[mids[::-1]] = np.arange(len(mids))[::-1]
    mids = np.flatnonzero(first >= 0)
    return mids, ends[first[mids]]


def keys(nodes: np.ndarray, count: int) -> np.ndarray:
    """One whole number for each row of nodes, (k, 1 to 3) of 0 to ``count`` - 1, whatever their order in the row."""
    nodes = nodes.astype(np.int64)
    if nodes.shape[1] == 2:        # rows of two are sorted slowly
        return np.minimum(nodes[:, 0], nodes[:, 1]) * count + np.maximum(nodes[:, 0], nodes[:, 1])
    nodes = np.sort(nodes, axis=1)
    key = nodes[:, 0]
    for column in nodes[:, 1:].T:
        key = key * count + column
    return key


def single(keys: np.ndarray) -> np.ndarray:
    """Which of some whole numbers (k,) occur only once, (k,)."""
    order = np.argsort(keys)
    twice = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    once = np.ones(len(keys), dtype=bool)
    once[order[twice]] = once[order[twice + 1]] = False
    return once


def quadratic_shapes(barycentric: np.ndarray, dim: int) -> np.ndarray:
    """Quadratic shape functions, in basix order, at barycentric coordinates (p, dim + 1): (p, 6 or 10)."""
    ends = np.array(EDGES[dim])
    return np.concatenate([barycentric * (2 * barycentric - 1),
                           4 * barycentric[:, ends[:, 0]] * barycentric[:, ends[:, 1]]], axis=1)
