"""The surface of a rigid tool in space from a CAD file, in triangles that are small only where it is curved."""

from __future__ import annotations

import numpy as np

from ..errors import MeshError, SceneError
from .bodies import import_cad
from .file_surfaces import quarters
from .gmsh_arrays import gmsh_model
from .parallel import on_first_rank

AROUND = 36         # sides on a full turn, each of them in two pieces: they lie 0.1 % of the radius off
SMALLEST = 2e-3     # of the diagonal: a tiny rounding along all of a die would be most of its triangles


def cad_triangles(path: str, scale: float, comm) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) mm and triangles (t, 3), wound alike, of the bodies in a file; the same on every rank. Collective.

    Raises
    ------
    SceneError
        if the file cannot be read, or holds no body.
    """
    def make():
        try:
            with gmsh_model() as gmsh:
                import_cad(gmsh, path, scale, 3)
                return _surface(gmsh)
        except MeshError as error:
            return str(error)
        except Exception as error:      # gmsh raises bare Exceptions
            return f"{path} cannot be read or meshed: {error}"

    found = comm.bcast(on_first_rank(comm, make), 0)
    if isinstance(found, str):
        raise SceneError(found, key="path", got=path, allowed="a CAD file of a body")
    return found


def _surface(gmsh) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
    large = float(np.linalg.norm(high - low))
    gmsh.model.mesh.setSize(gmsh.model.getEntities(0), large)       # else a tenth of the body on flat faces too
    for option, value in {"MeshSizeMax": large, "MeshSizeMin": SMALLEST * large, "MeshSizeFromCurvature": AROUND,
                          "MeshSizeExtendFromBoundary": 0}.items():
        gmsh.option.setNumber(f"Mesh.{option}", value)
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(2)
    tags, x, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    faces = []
    for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(3), combined=True, oriented=False):
        rows = number[gmsh.model.mesh.getElementsByType(9, tag)[1].astype(np.int64)].reshape(-1, 6)
        faces.append(quarters(rows[:, [0, 1, 2, 4, 5, 3]]))         # gmsh has the mid-node of an edge after its first end
    return x.reshape(-1, 3), np.concatenate(faces)
