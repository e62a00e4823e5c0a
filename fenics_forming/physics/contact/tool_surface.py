"""The surface of a deformable tool as workpieces meet it: its nodes the same on all ranks, in the tool's own frame."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..locating import by_coordinate
from ..nodes import EDGES
from ..parallel import everywhere
from ..surface import facet_sides
from ..tool_body.body import ToolBody
from ..tool_body.compliance import global_dofs
from .capture import CapturingSurface


class ToolSurface:
    """Nodes and sides of the surface of a tool.

    Parameters
    ----------
    body : the tool · facets : (f,) owned exterior facets of this rank, on no mirror plane
    facing : (k,) those of them that contact reaches first, all where None

    Attributes
    ----------
    x : (n, dim) mm, the nodes before they deform, in an order that no number of ranks changes
    sides : (f, 3 | 6) rows of ``x`` · dofs : (n, dim) global numbers of the displacements
    free : (n, dim) which displacements are not held · facing : (n,) which nodes contact reaches first
    size : mm, mean length of a side
    """

    def __init__(self, body: ToolBody, facets: np.ndarray, facing: np.ndarray | None = None):
        nodes, comm = body.nodes, body.nodes.comm
        own, shared = facet_sides(nodes, facets), nodes.mesh.geometry.index_map()

        def numbers_of(sides: np.ndarray) -> np.ndarray:
            found = np.asarray(shared.local_to_global(sides.ravel().astype(np.int32)), dtype=np.int64)
            return everywhere(comm, found.reshape(sides.shape))

        numbers = numbers_of(own)
        first_met = numbers if facing is None else numbers_of(facet_sides(nodes, facing))
        dim = nodes.dim
        data = np.concatenate([nodes.x[own], global_dofs(body, own.ravel()).reshape(*own.shape, dim),
                               ~body.is_held[own]], axis=2)
        data = everywhere(comm, data)
        known, first, rows = np.unique(numbers.ravel(), return_index=True, return_inverse=True)
        data = data.reshape(-1, 3 * dim)[first]
        span = float(np.ptp(data[:, :dim], axis=0).max())
        order = np.lexsort(np.round(data[:, :dim] / (1e-9 * span)).T)
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        data, sides = data[order], place[rows.ravel()].reshape(numbers.shape)
        self.facing = np.isin(known, first_met)[order]
        self.x, self.dofs, self.free = data[:, :dim], data[:, dim:2 * dim].astype(np.int64), data[:, 2 * dim:] > 0
        self.sides = sides[np.lexsort(sides.T)]
        self.dim, self.count, self._comm = dim, len(self.x), comm
        self._capturing = CapturingSurface(self.x[self.sides], self.sides)
        ends = self.x[self.sides[:, :dim]]
        self.size = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
        ones = np.ones(self.sides.size)
        per_side = sp.csr_matrix((ones, self.sides.ravel(), np.arange(0, ones.size + 1, self.sides.shape[1])),
                                 shape=(len(self.sides), self.count))
        self._neighbours = (per_side.T @ per_side).astype(bool)
        self._local = self._rows_of(body)

    def _rows_of(self, body: ToolBody) -> np.ndarray:
        """Local node of the mesh for every node of the surface that this rank owns, -1 elsewhere."""
        owned = np.flatnonzero(body.dofs[:, 0] < body.owned)
        numbers = global_dofs(body, owned)[:, 0]
        order = np.argsort(numbers)
        at = np.minimum(np.searchsorted(numbers[order], self.dofs[:, 0]), max(len(order) - 1, 0))
        if not len(order):
            return np.full(self.count, -1)
        return np.where(numbers[order[at]] == self.dofs[:, 0], owned[order[at]], -1)

    # ------------------------------------------------------------------ points over the surface
    def feet(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sides and shape functions, (k,) and (k, 3 | 6), where points (k, dim) in the tool's frame are nearest, and
        whether they are over the surface, not beyond its rim."""
        found = self._capturing.capture(points)
        return found.facet, found.shapes, found.over

    def interpolation(self, side: np.ndarray, shapes: np.ndarray, here: np.ndarray) -> sp.csr_matrix:
        """Vectors at the nodes, node by node → those at points on the sides, (k · dim, n · dim); no rows where not
        ``here``."""
        dim, width = self.dim, shapes.shape[1]
        values = np.repeat(shapes[here], dim, axis=0)
        columns = (self.sides[side[here]] * dim)[:, None, :] + np.arange(dim)[:, None]
        starts = np.append(0, np.cumsum(np.repeat(here, dim) * width))
        return sp.csr_matrix((values.ravel(), columns.ravel(), starts), shape=(len(side) * dim, self.count * dim))

    def displaced(self, side: np.ndarray, shapes: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Values (k, dim) of the nodal field ``u`` (n, dim) at points of the sides."""
        return np.einsum("ka,kai->ki", shapes, u[self.sides[side]])

    def turned(self, normal: np.ndarray, side: np.ndarray, shapes: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Normals (k, dim) at points of the sides after the nodes have moved by ``u`` (n, dim)."""
        p = self.x[self.sides[side]]
        before, after = (_normals(q, shapes) for q in (p, p + u[self.sides[side]]))
        normal = normal + after - before
        return normal / np.linalg.norm(normal, axis=1)[:, None]

    def beside(self, interpolation: sp.csr_matrix) -> sp.csr_matrix:
        """An interpolation, (k · dim, n · dim), with entries also for the nodes of the sides beside; their values mean
        nothing."""
        dim = self.dim
        blocks = sp.kron(self._neighbours, np.ones((dim, dim)), format="csr")
        return (interpolation.astype(bool).astype(float) @ blocks).tocsr()

    def around(self, nodes: np.ndarray, rings: int) -> np.ndarray:
        """Whether a node is one of ``nodes`` (n,) bool or so many sides away from one."""
        reached = nodes.astype(float)
        for _ in range(rings):
            reached = (self._neighbours @ reached > 0).astype(float)
        return reached > 0

    # ------------------------------------------------------------------ to and from the mesh
    def on_mesh(self, nodal: np.ndarray, body: ToolBody) -> np.ndarray:
        """Values (n, dim) of the surface at the nodes of the mesh that this rank owns, (nodes, dim), zero elsewhere."""
        out = np.zeros((body.nodes.count, self.dim))
        mine = self._local >= 0
        out[self._local[mine]] = nodal[mine]
        return out

    def from_mesh(self, nodal: np.ndarray) -> np.ndarray:
        """Values (nodes, dim) of the mesh at the nodes of the surface, (n, dim), on every rank. Collective."""
        mine = self._local >= 0
        out = np.zeros((self.count, self.dim))
        out[mine] = nodal[self._local[mine]]
        return self._comm.allreduce(out) if self._comm.size > 1 else out


def _normals(p: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Outward unit normals (k, dim) of sides with nodes ``p`` (k, 3 | 6, dim) where these have their ``shapes``."""
    dim = p.shape[2]
    inner = shapes[:, :dim].copy()          # a linear function is the quadratic one with its own mid-values
    for mid, (a, b) in enumerate(EDGES[dim - 1]):
        for end in (a, b):
            inner[:, end] += 0.5 * shapes[:, dim + mid]
    slope = by_coordinate(inner, p)
    tangents = slope[:, 1:] - slope[:, :1]
    normal = tangents[:, 0, ::-1] * [1.0, -1.0] if dim == 2 else np.cross(tangents[:, 0], tangents[:, 1])
    return normal / np.linalg.norm(normal, axis=1)[:, None]
