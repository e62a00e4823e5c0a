"""A body that nothing keeps from sliding."""

from __future__ import annotations

import numpy as np

from .contact.surfaces import Plane

PARALLEL = 1e-9     # sine of the angle between normals, squared


def slides_freely(tools, held: set[int], dim: int) -> bool:
    """Whether a body lies between opposed, parallel planes without friction, and neither they nor mirror planes, which hold
    the components ``held`` of its velocity, keep it from sliding along them: its place there would be chance."""
    if not all(isinstance(tool.surface, Plane) and not tool.has_friction for tool in tools):
        return False
    normals = np.array([tool.surface.normal for tool in tools]).reshape(-1, dim)
    along = normals @ normals[:1].T
    if not (along < 0).any() or (1 - along**2 > PARALLEL).any():
        return False
    return bool(np.linalg.matrix_rank(np.vstack([normals[:1], np.eye(dim)[sorted(held)]])) < dim)
