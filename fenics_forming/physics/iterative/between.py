"""Contact between bodies in the iterative solver: applied by the gap operator, never merged into the pattern."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from ..contact.interfaces import Interfaces
from ..workpiece import Workpiece
from .carried import CarriedProducts
from .everywhere import Everywhere
from .sharing import Shared
from .upper_half import BlockRows, on_vertices


@dataclass
class _Made:
    """An operator, the same on the vertices, and its products on one rank."""

    operator: PETSc.Mat
    vertices: BlockRows
    products: CarriedProducts | None


class BetweenBodies:
    """The tangent G^T w (-dt/ds) G of all pairs of bodies, as a product and by its diagonal blocks, and on the vertices.

    Parameters
    ----------
    nodes : of the mesh, shared · everywhere : the common order of the vertices
    """

    def __init__(self, workpiece: Workpiece, interfaces: Interfaces, nodes: Shared, everywhere: Everywhere):
        self._interfaces, self._nodes = interfaces, nodes
        self._own = workpiece.velocity_dofs[: nodes.owned]
        self._x = PETSc.Vec().createMPI((workpiece.owned, None), comm=nodes.comm)
        self._y = self._x.duplicate()
        self._node_of = np.full(workpiece.owned, -1)
        for axis in range(3):
            self._node_of[self._own[:, axis]] = np.arange(nodes.owned)
        local = np.concatenate([contact.unknowns[:, 0] for contact in interfaces.contacts]) - self._first()
        near = self._node_of[local[(local >= 0) & (local < workpiece.owned)]]
        self._near = np.unique(near)        # nodes of the surfaces that contacts may move, of this rank
        self._weighted: list[np.ndarray] = []
        self._carried: dict[int, _Made] = {}        # by contact
        self._alone = nodes.comm.size == 1
        n = workpiece.nodes
        self._ends = np.zeros((n.count, 2), np.int64)       # vertices that a node is in the middle of, in the common order
        self._ends[n.is_vertex] = everywhere.numbers[n.scalar_dofs[n.is_vertex]][:, None]
        mids, of_mids = n.edge_middles()
        self._ends[mids] = everywhere.numbers[n.scalar_dofs[of_mids]]
        self._linear = None if self._alone else self._prolongation(workpiece, everywhere)

    def _prolongation(self, workpiece: Workpiece, everywhere: Everywhere) -> PETSc.Mat:
        """All unknowns, of velocities that are linear in every cell: by those of the vertices in the common order."""
        ends, axes = self._ends, np.arange(3)
        first = self._x.getOwnershipRange()[0]
        rows = np.repeat((first + self._own)[:, :, None], 2, axis=2)
        columns = 3 * ends[: self._nodes.owned, None, :] + axes[:, None]
        size = ((workpiece.owned, None), (None, 3 * everywhere.count))
        P = PETSc.Mat().createAIJ(size, nnz=(2, 2), comm=self._nodes.comm)
        P.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        order = np.argsort(rows[:, :, 0].ravel())
        starts = np.zeros(workpiece.owned + 1, PETSc.IntType)
        np.add.at(starts, self._own.ravel() + 1, 2)
        P.setValuesCSR(np.cumsum(starts).astype(PETSc.IntType), columns.reshape(-1, 2)[order].ravel().astype(PETSc.IntType),
                       np.full(columns.size, 0.5), PETSc.InsertMode.ADD_VALUES)
        P.assemble()
        return P

    def add_product(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with velocities x (nodes, 3) to the owners' rows of y. Collective."""
        start = process_time()
        if self._alone:
            for contact, weighted in zip(self._interfaces.contacts, self._weighted, strict=True):
                self._made_of(contact).products.add_product(weighted, x, y)
        else:
            self._add_product_of_all(x, y)
        self._interfaces.book(process_time() - start)

    def _add_product_of_all(self, x: np.ndarray, y: np.ndarray) -> None:
        near, dofs = self._near, self._own[self._near]
        self._x.array[dofs] = x[near]
        for contact, weighted in zip(self._interfaces.contacts, self._weighted, strict=True):
            at_points = contact.G.createVecLeft()
            contact.G.mult(self._x, at_points)
            at_points.array[:] = np.matmul(weighted, at_points.array.reshape(-1, 3, 1)).ravel()
            contact.G.multTranspose(at_points, self._y)
            y[near] += self._y.array[dofs]

    def add_diagonal(self, blocks: np.ndarray) -> None:
        """Add the blocks of the diagonal to the owners' of ``blocks`` (nodes, 9). Collective."""
        start, counted = process_time(), self._interfaces.seconds
        self._weighted = [contact.weighted_tangent() for contact in self._interfaces.contacts]
        for contact, weighted in zip(self._interfaces.contacts, self._weighted, strict=True):
            if self._alone:
                self._made_of(contact).products.add_diagonal(weighted, blocks)
                continue
            dofs, found = contact.diagonal()
            local = dofs - self._first()
            mine = np.flatnonzero((local >= 0) & (local < len(self._node_of)))
            blocks[self._node_of[local[mine]]] += found[mine].reshape(-1, 9)
        self._interfaces.book(process_time() - start - self._interfaces.seconds + counted)

    def _made_of(self, contact) -> _Made:
        """What is made of the operator of a contact, once for each. Collective."""
        known = self._carried.get(id(contact))
        if known is None or known.operator is not contact.G:
            if self._alone:
                nodes = self._node_of[contact.unknowns[:, 0]]
                known = _Made(contact.G, on_vertices(contact.rows, contact.free, self._ends[nodes]),
                              CarriedProducts(contact.rows, nodes, contact.free))
            else:
                known = _Made(contact.G, self._times_linear(contact.G), None)
            self._carried[id(contact)] = known
        return known

    def _times_linear(self, G: PETSc.Mat) -> BlockRows:
        product = G.matMult(self._linear)
        starts, columns, values = product.getValuesCSR()
        rows = sparse.csr_matrix((values, columns, starts), (len(starts) - 1, product.size[1])).tobsr((3, 3))
        rows.sort_indices()
        product.destroy()
        return BlockRows(rows.indptr, rows.indices, rows.data)

    def _first(self) -> int:
        return self._x.getOwnershipRange()[0]

    def vertex_rows(self) -> list[BlockRows]:
        """The operators on the vertices in the common order, contact by contact, of this rank's carriers. Collective."""
        return [self._made_of(contact).vertices for contact in self._interfaces.contacts]
