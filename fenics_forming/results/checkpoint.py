"""Checkpoints: the state of one body in one file that any number of ranks can write and read."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..physics.gather import (
    gather_cell_values,
    gather_cells,
    gather_facets,
    gather_nodal,
    scatter_cell_values,
    scatter_nodal,
)
from .files import ResultsError, on_rank_zero, whole_file

if TYPE_CHECKING:  # results are read without dolfinx
    from ..physics.contact.facets import ContactFacets
    from ..physics.nodes import Nodes

KIND = "fenics_forming checkpoint 1"


@dataclass(frozen=True)
class Checkpoint:
    """What a checkpoint holds.

    Attributes
    ----------
    scalars : what was given as such (anything that JSON can hold)
    nodal, cellwise : arrays by name, rows in the order of the mesh as it was given, or local to a `Nodes`
    facetwise : arrays by name as `gather_facets` makes them, never local
    between : the same for every pair of bodies that may touch
    whole : arrays by name that belong to no place of the mesh, the same on all ranks
    positions : (nodes, dim) mm, where the nodes lay; rows as in ``nodal``
    cells : (cells, nodes per cell) rows of the nodes, basix order, in the order of the mesh as it was given
    """

    scalars: dict
    nodal: dict[str, np.ndarray]
    positions: np.ndarray
    cells: np.ndarray = field(repr=False)
    cellwise: dict[str, np.ndarray] = field(default_factory=dict)
    facetwise: dict[str, np.ndarray] = field(default_factory=dict)
    between: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    whole: dict[str, np.ndarray] = field(default_factory=dict)

    def mesh(self, comm):
        """The mesh as it was, order 2, distributed over the ranks of ``comm``. Collective.

        A checkpoint loaded without nodes is meant, so that positions and cells are those of the whole body.
        """
        import basix.ufl
        from dolfinx.mesh import create_mesh

        dim = self.positions.shape[1]
        shape = {2: "triangle", 3: "tetrahedron"}[dim]
        mine = slice(None) if comm.rank == 0 else slice(0)
        return create_mesh(
            comm,
            self.cells[mine].astype(np.int64),
            self.positions[mine],
            basix.ufl.element("Lagrange", shape, 2, shape=(dim,)),
        )


def save_checkpoint(
    path: Path | str,
    nodes: Nodes,
    *,
    scalars: dict,
    nodal: dict[str, np.ndarray],
    cellwise: dict[str, np.ndarray] | None = None,
    facetwise: dict[str, np.ndarray] | None = None,
    facets: ContactFacets | None = None,
    between: dict[str, tuple] | None = None,
    whole: dict[str, np.ndarray] | None = None,
) -> None:
    """Write the state of one body; an interrupted write leaves the checkpoint before it. Collective.

    Parameters
    ----------
    path : the ``.npz`` file
    scalars : numbers, words, lists and dictionaries of them
    nodal : values at the nodes, (count, …)
    cellwise : values per owned cell, (cells, …)
    facetwise : values at the points of the contact ``facets``, (points, k)
    between : pair of bodies → points on the surface of one of them, and values there by name, (points, k)
    whole : arrays of any shape, the same on all ranks
    """
    path = Path(path)
    arrays = {"cells": gather_cells(nodes), "positions": gather_nodal(nodes, nodes.x)}
    arrays |= {f"nodal.{name}": gather_nodal(nodes, values) for name, values in nodal.items()}
    arrays |= {
        f"cellwise.{name}": gather_cell_values(nodes, values) for name, values in (cellwise or {}).items()
    }
    if facets is not None:
        gathered = gather_facets(nodes, facets, facetwise or {}) or {}
        arrays |= {f"facetwise.{name}": values for name, values in gathered.items()}
    for pair, (points, values) in (between or {}).items():
        gathered = gather_facets(nodes, points, values) or {}
        arrays |= {f"between.{pair}.{name}": array for name, array in gathered.items()}
    arrays |= {f"whole.{name}": values for name, values in (whole or {}).items()}
    words = json.dumps(scalars, default=_plain)

    def write():
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as partial, open(partial, "wb") as file:
            np.savez(file, kind=KIND, scalars=words, **arrays)

    on_rank_zero(nodes.comm, write)


def load_checkpoint(path: Path | str, nodes: Nodes | None = None) -> Checkpoint:
    """Read a checkpoint; with ``nodes`` the arrays are local to that mesh, on any number of ranks.

    Collective where nodes are given.

    Raises
    ------
    ResultsError
        if the file is missing or damaged, or if ``nodes`` are those of another mesh.
    """
    path = Path(path)
    if nodes is None:
        return _read(path)
    comm = nodes.comm
    cells = gather_cells(nodes)
    loaded = on_rank_zero(comm, lambda: _fitting(_read(path), cells, path))
    return Checkpoint(
        scalars=loaded.scalars,
        cells=loaded.cells,
        positions=scatter_nodal(nodes, loaded.positions),
        nodal={name: scatter_nodal(nodes, values) for name, values in loaded.nodal.items()},
        cellwise={name: scatter_cell_values(nodes, values) for name, values in loaded.cellwise.items()},
        facetwise=loaded.facetwise,
        between=loaded.between,
        whole=loaded.whole,
    )


def _fitting(checkpoint, cells, path):
    if not np.array_equal(checkpoint.cells, cells):
        raise ResultsError(
            f"the checkpoint '{path}' has {len(checkpoint.cells)} cells and belongs to another mesh "
            f"(this one: {len(cells)}); build the mesh from the checkpoint: load_checkpoint(path).mesh(comm)"
        )
    return checkpoint


def _read(path):
    if not path.exists():
        raise ResultsError(f"there is no checkpoint '{path}'; a run writes one when its scene asks for it")
    try:
        with np.load(path, allow_pickle=False) as file:
            if str(file["kind"]) != KIND:
                raise ValueError(f"it is a '{file['kind']}', not a '{KIND}'")
            return Checkpoint(
                scalars=json.loads(str(file["scalars"])),
                nodal=_named(file, "nodal"),
                positions=file["positions"],
                cells=file["cells"],
                cellwise=_named(file, "cellwise"),
                facetwise=_named(file, "facetwise"),
                between=_by_pair(_named(file, "between")),
                whole=_named(file, "whole"),
            )
    except Exception as error:  # zipfile, zlib, numpy and json each have their own
        raise ResultsError(f"the checkpoint '{path}' is damaged or is not one: {error}") from error


def _named(file, kind):
    return {key.split(".", 1)[1]: file[key] for key in file.files if key.startswith(kind + ".")}


def _by_pair(arrays):
    pairs: dict[str, dict[str, np.ndarray]] = {}
    for key, array in arrays.items():
        pair, name = key.split(".", 1)
        pairs.setdefault(pair, {})[name] = array
    return pairs


def _plain(value):
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a checkpoint cannot hold {value!r} among its scalars")
