"""gmsh fills a closed triangulated surface with tetrahedra: the rescue where the old cells are of no use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..meshing import gmsh_model
from .straight import Straight, volumes


def refill(mesh: Straight) -> Straight:
    """The same surface, facet by facet, with new cells inside whose size follows the facets.

    Raises
    ------
    RuntimeError
        when gmsh cannot fill it, because the surface cuts itself.
    """
    used, facets = np.unique(mesh.facets, return_inverse=True)
    facets = facets.reshape(-1, 3)
    with gmsh_model() as gmsh:
        try:
            _discrete_surface(gmsh, mesh.x[used], facets, mesh.patch)
            gmsh.option.setNumber("Mesh.Renumber", 0)       # the nodes of the surface are known by their numbers
            gmsh.model.mesh.generate(3)
        except Exception as error:  # gmsh raises bare Exceptions
            raise RuntimeError(str(error)) from error
        finally:
            gmsh.option.setNumber("Mesh.Renumber", 1)
        tags, x, _ = gmsh.model.mesh.getNodes()
        _, cells = gmsh.model.mesh.getElementsByType(4)
    if len(cells) == 0:
        raise RuntimeError("no cells inside the surface")
    order = np.argsort(tags)
    cells = np.searchsorted(tags[order], cells).reshape(-1, 4)
    x = x.reshape(-1, 3)[order]
    turned = volumes(x, cells) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    if volumes(x, cells).min() <= 0:
        raise RuntimeError("cells without volume")
    number = np.full(len(mesh.x), -1)
    number[used] = np.arange(len(used))
    return replace(mesh, x=x, cells=cells, facets=facets, lines=number[mesh.lines], corners=number[mesh.corners])


def _discrete_surface(gmsh, x, facets, patch):
    """A volume bounded by one discrete surface for each patch; nodes and facets keep their numbers."""
    patches = [int(k) + 1 for k in np.unique(patch)]
    for k in patches:
        gmsh.model.addDiscreteEntity(2, k)
    gmsh.model.mesh.addNodes(2, patches[0], np.arange(1, len(x) + 1), x.ravel())
    for k in patches:
        rows = np.flatnonzero(patch + 1 == k)
        gmsh.model.mesh.addElementsByType(k, 2, rows + 1, (facets[rows] + 1).ravel())
    gmsh.model.mesh.reclassifyNodes()
    loop = gmsh.model.geo.addSurfaceLoop(patches)
    gmsh.model.geo.addVolume([loop])
    gmsh.model.geo.synchronize()
