"""The sides of a mesh that lie on its boundary."""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh


def boundary_facets(mesh: dmesh.Mesh, where) -> np.ndarray:
    """Owned exterior facets of which every vertex satisfies ``where(x)`` (x is (3, n), as in dolfinx)."""
    dim = mesh.topology.dim
    facets = dmesh.locate_entities_boundary(mesh, dim - 1, where)
    return facets[facets < mesh.topology.index_map(dim - 1).size_local]


def exterior_facets(mesh: dmesh.Mesh) -> np.ndarray:
    """All owned exterior facets."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    return dmesh.exterior_facet_indices(mesh.topology)


def mean_lengths(corners: np.ndarray) -> np.ndarray:
    """Mean length of the edges of each side by its vertices (f, dim, dim), mm, (f,).

    Of a triangle all three count: which of its vertices comes first in a submesh depends on the number of ranks.
    """
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
