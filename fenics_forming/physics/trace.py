"""Velocities at the contact points as a matrix."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp


def trace_operator(workpiece) -> sp.csr_matrix:
    """Velocities at the contact points from the unknowns of this rank, (points · dim, local dofs)."""
    facets, dim = workpiece.contact.facets, workpiece.nodes.dim
    per = facets.points_per_facet
    nodes = np.repeat(facets.facet_nodes, per, axis=0)                       # (points, nodes of a facet)
    shapes = np.tile(facets.shape, (len(facets.facet_nodes), 1))
    columns = workpiece.velocity_dofs[nodes].swapaxes(1, 2)                  # (points, dim, nodes)
    values = np.broadcast_to(shapes[:, None, :], columns.shape)
    starts = np.arange(0, columns.size + 1, columns.shape[2])
    size = len(workpiece.solution.x.array)
    return sp.csr_matrix((values.ravel(), columns.ravel(), starts), shape=(facets.count * dim, size))
