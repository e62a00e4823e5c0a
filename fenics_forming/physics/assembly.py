"""The workpieces of a scene as one mesh: each made as if it were alone, then put side by side."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..errors import MeshError
from ..scene import Scene
from . import meshing
from .bodies import body_mesh
from .gather import gather_cells, gather_nodal
from .nodes import Nodes


def assembled_mesh(scene: Scene, tools, comm=MPI.COMM_WORLD):
    """Mesh of all workpieces, cells in the order of the bodies; mesh size of each, mm; number of cells of each. Collective.

    Raises
    ------
    MeshError
        if one of them cannot be meshed; the sentence names it.
    """
    x, cells, sizes, counts = [], [], [], []
    for name in scene.workpieces:
        try:
            mesh, size = body_mesh(scene.alone(name), tools, comm)
        except MeshError as error:
            raise MeshError(f"workpiece '{name}': {error}") from error
        nodes = Nodes(mesh)
        sizes.append(size)
        counts.append(int(mesh.topology.index_map(nodes.dim).size_global))
        x.append(gather_nodal(nodes, nodes.x))
        cells.append(gather_cells(nodes))
    dim = scene.dimension
    if comm.rank == 0:
        first = np.cumsum([0, *(len(a) for a in x[:-1])])
        joined = np.concatenate(x), np.concatenate([c + n for c, n in zip(cells, first, strict=True)])
    else:
        joined = np.empty((0, dim)), np.empty((0, {2: 6, 3: 10}[dim]), np.int64)
    return meshing.from_arrays(*joined, comm), sizes, counts
