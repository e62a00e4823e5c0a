"""Whether supports leave a body free to move as a whole: found from its rigid motions, before anything is factorised."""

from __future__ import annotations

import numpy as np

from ..parallel import total

_FREE = 1e-10       # of the largest hold on any motion: the shares of held motions are of order one


def rigid_motions(points: np.ndarray, kinematics) -> np.ndarray:
    """Translations (and small rotations about the origin) at points (n, dim): (motions, n, dim).

    In axisymmetry there is one, along the axis.
    """
    dim = points.shape[1]
    shifts = np.broadcast_to(np.eye(dim)[:, None], (dim, len(points), dim))
    if kinematics.name == "axisymmetric":
        return shifts[1:]
    axes = np.eye(3) if dim == 3 else np.eye(3)[2:]
    padded = np.pad(points, ((0, 0), (0, 3 - dim)))
    return np.concatenate([shifts, [np.cross(axis, padded)[:, :dim] for axis in axes]])


def free_motions(body) -> int:
    """How many independent rigid motions of a `ToolBody` neither held components nor springs resist. Collective."""
    nodes, kin = body.nodes, body.state.kinematics
    low, high = nodes.extents()
    size = float(np.linalg.norm(high - low))

    def motions(points):
        return rigid_motions((points - 0.5 * (low + high)) / size, kin)

    at = motions(nodes.x)
    held = body.is_held | (body.point_springs > 0)
    rows = [at[:, held]] + [np.einsum("mni,ni->mn", motions(p), d) for p, d in body.spread_springs()]
    hold = total(nodes.comm, sum(r @ r.T for r in rows))
    return int(np.count_nonzero(np.linalg.eigvalsh(hold) <= _FREE * max(1.0, np.abs(hold).max())))
