"""Several bodies in one mesh, as disjoint parts of it: which cells and nodes are whose, and which law holds where."""

from __future__ import annotations

import numpy as np

from .nodes import Nodes


class Parts:
    """The bodies of a mesh.

    Parameters
    ----------
    nodes : of the mesh, whose cells were given body by body
    names : of the bodies, in that order
    counts : number of cells of each

    Attributes
    ----------
    of_cell : (cells,) number of the body of every owned cell · of_all_cells : of those of this rank, ghosts included
    of_node : (nodes,) number of the body of every node
    """

    def __init__(self, nodes: Nodes, names, counts):
        self.nodes, self.names, self.counts = nodes, tuple(names), [int(c) for c in counts]
        given = np.asarray(nodes.mesh.topology.original_cell_index)
        self.of_all_cells = of_all = np.searchsorted(np.cumsum(self.counts), given, side="right")
        self.of_cell = of_all[: len(nodes.cells)]
        self.of_node = np.zeros(nodes.count, int)
        dofmap = nodes.mesh.geometry.dofmap
        self.of_node[dofmap] = of_all[: len(dofmap), None]

    def facets_of(self, name: str, facets: np.ndarray) -> np.ndarray:
        """Those of the owned exterior ``facets`` that belong to a body."""
        mesh, dim = self.nodes.mesh, self.nodes.dim
        mesh.topology.create_connectivity(dim - 1, dim)
        to_cell = mesh.topology.connectivity(dim - 1, dim)
        cells = to_cell.array[to_cell.offsets[facets]]
        return facets[self.of_cell[cells] == self.names.index(name)]

    def cells_of(self, name: str) -> np.ndarray:
        """Owned cells of a body, by number."""
        return np.flatnonzero(self.of_cell == self.names.index(name))

    def local_cells_of(self, name: str) -> np.ndarray:
        """Cells of a body that this rank has, ghosts included, by number."""
        return np.flatnonzero(self.of_all_cells == self.names.index(name)).astype(np.int32)

    def nodal(self, values) -> np.ndarray:
        """(nodes,) from one value for each body."""
        return np.asarray(values, float)[self.of_node]


class LawsByRow:
    """Flow-stress laws of several bodies as one, for arrays whose rows belong to known bodies.

    Parameters
    ----------
    laws : of the bodies
    rows : number of the body of every row, in the shape of the arrays that the law will be asked with
    """

    def __init__(self, laws, rows: np.ndarray):
        self._laws, self._shape = tuple(laws), rows.shape
        self._rows = [np.flatnonzero(rows.ravel() == k) for k in range(len(self._laws))]
        self.depends_on_rate = any(law.depends_on_rate for law in self._laws)
        self.depends_on_temperature = any(law.depends_on_temperature for law in self._laws)

    def __call__(self, strain, rate, temperature=None) -> np.ndarray:
        """Flow stress, MPa."""
        return self._each(lambda law, s, r, t: law(s, r, t), strain, rate, temperature)

    def rate_derivative(self, strain, rate, temperature=None) -> np.ndarray:
        """Its derivative by the strain rate, MPa s."""
        return self._each(lambda law, s, r, t: law.rate_derivative(s, r, t) if law.depends_on_rate else 0.0,
                          strain, rate, temperature)

    def _each(self, answer, strain, rate, temperature):
        out = np.empty(int(np.prod(self._shape)))
        strain, rate = np.ravel(strain), np.ravel(rate)
        for law, rows in zip(self._laws, self._rows, strict=True):
            warm = np.ravel(temperature)[rows] if law.depends_on_temperature else None
            out[rows] = answer(law, strain[rows], rate[rows], warm)
        return out.reshape(self._shape)


class DamageByRow:
    """Damage laws of several bodies as one; None where a body gathers none."""

    def __init__(self, laws, rows: np.ndarray):
        self._laws, self._rows = tuple(laws), rows

    def rate(self, principal_stress: np.ndarray, flow_stress: np.ndarray) -> np.ndarray:
        """Damage per unit of effective strain."""
        out = np.zeros(self._rows.shape)
        for k, law in enumerate(self._laws):
            if law is not None:
                mine = self._rows == k
                out[mine] = law.rate(principal_stress[mine], flow_stress[mine])
        return out
