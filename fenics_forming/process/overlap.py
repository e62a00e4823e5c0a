"""Whether a body and its tools overlap where they stand at the start, of shapes that only a file knows.

Other shapes are compared before any mesh (`scene.placement`). Nodes that lie in a tool are put onto it at the start. That
is right for the thousandths of a side by which the triangles of a file cut through a round body, and turns cells inside out
where a die has been drawn in the wrong place or faces the wrong way.
"""

from __future__ import annotations

import numpy as np

from ..errors import SceneError
from ..physics.parallel import everywhere

DEEP = 0.25     # of the side of an element: what is put back farther spoils the cells below
SEEN = 0.02     # of it: more than triangles leave


def overlaps(scene, body) -> list[str]:
    """Warnings of small overlaps of a `FlowingBody` that has just been built. Collective.

    Raises
    ------
    SceneError
        where a node lies deep in a tool.
    """
    from_files = any(workpiece.shape.file is not None for workpiece in scene.workpieces.values())
    side = body.contact.facets.size() if body.contact is not None else 0.0
    warnings = []
    for tool in body.tools:
        shape = scene.tools[tool.name].shape
        if not from_files and (shape is None or shape.file is None):
            continue
        depth, *at = _deepest(body, tool)
        said = f"{depth:.3g} mm deep at ({', '.join(f'{x:.4g}' for x in at)})"
        key = f"tools.{tool.name}.shape"
        if depth > DEEP * side:
            raise SceneError(f"overlaps the workpiece at the start, {said}; move it, or turn its normals towards the "
                             "workpiece", key=key, got=depth, allowed="no overlap")
        if depth > SEEN * side:
            warnings.append(f"{key}: overlaps the workpiece at the start, {said}; what lies inside is put onto its surface")
    return warnings


def _deepest(body, tool) -> np.ndarray:
    """Depth of the node that lies deepest in the tool, and its place, mm. Collective."""
    x = body.x[body.boundary]
    gap, _ = tool.gap(x)
    own = np.zeros((0, 1 + x.shape[1])) if len(x) == 0 else np.concatenate([[-gap.min()], x[gap.argmin()]])[None]
    rows = everywhere(body.nodes.comm, own)
    return rows[rows[:, 0].argmax()]
