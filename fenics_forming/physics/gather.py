"""Values of all ranks on rank 0, in the order in which the mesh was given, and back again.

Rows follow ``mesh.geometry.input_global_indices`` and ``mesh.topology.original_cell_index`` (closed up where
an index is not used), so that what is gathered does not depend on the number of ranks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

if TYPE_CHECKING:  # results are read without dolfinx, through this module
    from .contact.facets import ContactFacets
    from .nodes import Nodes


class Numbering:
    """Row of every local node and owned cell in the gathered arrays. Making one is collective."""

    def __init__(self, nodes: Nodes):
        geometry, topology = nodes.mesh.geometry, nodes.mesh.topology
        self.owned = geometry.index_map().size_local
        given = np.asarray(geometry.input_global_indices)
        every = np.sort(_all(nodes.comm, given[: self.owned]))
        self.node_rows = np.searchsorted(every, given)
        cells = np.asarray(topology.original_cell_index)[: len(nodes.cells)]
        self.cell_rows = np.searchsorted(np.sort(_all(nodes.comm, cells)), cells)


_numberings: WeakKeyDictionary[Nodes, Numbering] = WeakKeyDictionary()


def numbering(nodes: Nodes) -> Numbering:
    """The `Numbering` of a mesh, made once (collective then)."""
    if nodes not in _numberings:
        _numberings[nodes] = Numbering(nodes)
    return _numberings[nodes]


def gather_nodal(nodes: Nodes, values: np.ndarray) -> np.ndarray | None:
    """Nodal values (count, …) of all ranks in rows: the array on rank 0, None elsewhere. Collective."""
    rows = numbering(nodes)
    return _gather(nodes.comm, rows.node_rows[: rows.owned], np.asarray(values)[: rows.owned])


def gather_cell_values(nodes: Nodes, values: np.ndarray) -> np.ndarray | None:
    """Values per owned cell (cells, …) of all ranks in rows: on rank 0, None elsewhere. Collective."""
    return _gather(nodes.comm, numbering(nodes).cell_rows, np.asarray(values))


def gather_cells(nodes: Nodes) -> np.ndarray | None:
    """Rows of the nodes of each cell, (cells, nodes per cell), basix order: rank 0 only. Collective."""
    return gather_cell_values(nodes, numbering(nodes).node_rows[nodes.cells])


def scatter_nodal(nodes: Nodes, values: np.ndarray | None) -> np.ndarray:
    """The local part (count, …), ghosts included, of gathered nodal values given on rank 0. Collective."""
    return nodes.comm.bcast(values, 0)[numbering(nodes).node_rows]


def scatter_cell_values(nodes: Nodes, values: np.ndarray | None) -> np.ndarray:
    """The local part of gathered values per cell given on rank 0: (cells, …). Collective."""
    return nodes.comm.bcast(values, 0)[numbering(nodes).cell_rows]


def gather_facets(nodes: Nodes, facets: ContactFacets, values: dict[str, np.ndarray]) -> dict[str, np.ndarray] | None:
    """Values (points, k) on contact facets on rank 0, None elsewhere: by name (facets, points per facet, k). Collective.

    The facets are sorted by the rows of their vertices, given as "vertices", their points by those vertices too.
    """
    vertices, points = facets.points_from(numbering(nodes).node_rows)
    local = np.arange(len(points))[:, None]
    seen = {n: v.reshape(len(points), facets.points_per_facet, v.shape[1])[local, points] for n, v in values.items()}
    parts = nodes.comm.gather({"vertices": vertices, **seen}, 0)
    if parts is None:
        return None
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    order = np.lexsort(whole["vertices"].T[::-1])
    return {name: array[order] for name, array in whole.items()}


def scatter_facets(nodes: Nodes, facets: ContactFacets, gathered: dict[str, np.ndarray] | None) -> dict[str, np.ndarray]:
    """The local part (points, k), by name, of what :func:`gather_facets` gave on rank 0. Collective."""
    gathered = nodes.comm.bcast(gathered, 0)
    vertices, points = facets.points_from(numbering(nodes).node_rows)
    row_of = {tuple(corners): row for row, corners in enumerate(gathered["vertices"].tolist())}
    rows = np.array([row_of[tuple(corners)] for corners in vertices.tolist()], dtype=int)
    out = {}
    for name in gathered.keys() - {"vertices"}:
        values = np.empty((len(rows),) + gathered[name].shape[1:])
        values[np.arange(len(rows))[:, None], points] = gathered[name][rows]
        out[name] = values.reshape(-1, values.shape[-1])
    return out


def _all(comm, values):
    return np.concatenate(comm.allgather(values)) if comm.size > 1 else values


def _gather(comm, rows, values):
    parts = comm.gather((rows, values), 0) if comm.size > 1 else [(rows, values)]
    if comm.rank != 0:
        return None
    out = np.empty((sum(len(r) for r, _ in parts),) + values.shape[1:], values.dtype)
    for part_rows, part in parts:
        out[part_rows] = part
    return out
