"""Along which direction the history counts the force of a tool."""

from __future__ import annotations

import numpy as np

FACES = 0.7071      # cosine: a tool at rest faces the main tool where no axis at right angles to its way is nearer
NEAR = 0.02         # of the size of the body: as near as this counts as nearest
DRAGS = 0.05        # cosine: a tool whose way lies in its surface, like that of a belt, drags and does not press


def pushing_direction(scene, tools, tool, extents) -> np.ndarray:
    """Unit vector (dim,) in which a tool pushes.

    That is the way of its drive, or against it where that leads away from all of the body. At rest, or only turning, it
    pushes towards the body as it was at the start: along the way of the main tool where it faces that, in the middle of the
    body or where it is nearest to it, else across it. Where the main tool drags, a flat tool pushes along its normal; any
    other one, and all where no tool has a way, along an axis. In axisymmetry a resting tool pushes along the axis, where
    alone forces have a resultant.

    Parameters
    ----------
    scene : the process · tools : all tools of the run, with `name` and `gap(x)` → (distance (n,), normals (n, dim)) ·
    tool : one of them · extents : lowest and highest place of the body at the start, 2 x (dim,) mm
    """
    low, high = np.array(extents)
    corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1)), axis=-1).reshape(-1, len(low))
    if (way := _way(scene, tool.name)) is not None:
        return -way if (tool.gap(corners)[1] @ way < -FACES).all() else way
    normal = tool.gap(np.array([0.5 * (low + high)]))[1][0]
    axis = int(np.argmax(np.abs(normal)))
    main = _way(scene, scene.counting_tool)
    if scene.geometry == "axisymmetric":
        if axis == 0 and main is not None and main[1] != 0:       # beside the body: it holds back what is pushed
            normal = -main
        axis = 1
    elif main is not None:
        counting = next(other for other in tools if other.name == scene.counting_tool)
        if (np.abs(counting.gap(corners)[1] @ main) < DRAGS).all():
            if np.ptp(tool.gap(corners)[1], axis=0).max() == 0:
                return normal
        else:
            for facing in (float(normal @ main), float(_where_nearest(tool, low, high) @ main)):
                if abs(facing) > FACES:
                    return np.copysign(1.0, facing) * main
            across = normal - normal @ main * main
            return across / np.linalg.norm(across)
    return np.copysign(1.0, normal[axis]) * np.eye(len(low))[axis]


def _where_nearest(tool, low, high) -> np.ndarray:
    """Mean normal (dim,) of a tool where it is nearest to the box around the body: a support faces a punch beside it."""
    dim = len(low)
    box = np.stack(np.meshgrid(*np.linspace(low, high, 21 if dim == 2 else 7).T), axis=-1).reshape(-1, dim)
    gap, normals = tool.gap(box)
    mean = normals[gap < gap.min() + NEAR * np.linalg.norm(high - low)].mean(axis=0)
    return mean / max(float(np.linalg.norm(mean)), 1e-12)


def _way(scene, name) -> np.ndarray | None:
    """Unit vector along which the drive of a tool goes; None without a drive that has one."""
    drive = None if name is None else scene.tools[name].drive
    return None if drive is None or drive.direction is None else np.asarray(drive.direction, float)
