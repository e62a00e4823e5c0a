"""Several bodies of a scene as one mesh: each made as if it were alone, then put side by side."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..errors import MeshError
from ..scene import Scene
from . import meshing
from .bodies import body_mesh
from .gather import gather_cells, gather_nodal
from .grading import GROWTH
from .nodes import Nodes


def assembled_mesh(scene: Scene, tools, comm=MPI.COMM_WORLD):
    """Mesh of all workpieces, cells in the order of the bodies; mesh size of each, mm; number of cells of each. Collective.

    Raises
    ------
    MeshError
        if one of them cannot be meshed; the sentence names it.
    """
    meshes, sizes = [], []
    for name in scene.workpieces:
        try:
            # where bodies meet, their sizes decide which holds the points: not also those at the edge of a tool
            mesh, size = body_mesh(scene.alone(name), tools, comm, edge_growth=GROWTH)
        except MeshError as error:
            raise MeshError(f"workpiece '{name}': {error}") from error
        meshes.append(mesh)
        sizes.append(size)
    joined, counts = side_by_side(meshes, scene.dimension, comm)
    return joined, sizes, counts


def side_by_side(meshes, dim: int, comm=MPI.COMM_WORLD):
    """Several meshes as disjoint parts of one, cells in their order; number of cells of each. Collective."""
    counts = [int(mesh.topology.index_map(dim).size_global) for mesh in meshes]
    if len(meshes) == 1:
        return meshes[0], counts
    parts = [Nodes(mesh) for mesh in meshes]
    x, cells = [gather_nodal(nodes, nodes.x) for nodes in parts], [gather_cells(nodes) for nodes in parts]
    if comm.rank == 0:
        first = np.cumsum([0, *(len(a) for a in x[:-1])])
        joined = np.concatenate(x), np.concatenate([c + n for c, n in zip(cells, first, strict=True)])
    else:
        joined = np.empty((0, dim)), np.empty((0, {2: 6, 3: 10}[dim]), np.int64)
    return meshing.from_arrays(*joined, comm), counts
