r"""What the next solve of a body that turns starts from.

The nodes carry their velocities along. Once the body has turned by an angle a they are no longer those of a rotation, but
of one and of a contraction across its axis at the rate :math:`\omega\sin a`: a ring that is rolled by five degrees in a
step, rigid as most of it is, would start every solve as if it flowed everywhere. So the next one starts from

.. math:: v + W\,(x - x_0) ,

with the nodes at x, where v has been found with them at :math:`x_0`, and the spin W of the rigid motion nearest to v. Of a
ring between rolls that takes a fifth of the iterations away.
"""

from __future__ import annotations

import numpy as np

from ..physics.parallel import highest, total


def turn(body, before: np.ndarray) -> None:
    """Turn the velocities that the next solve of a `FlowingBody` starts from. Collective.

    Each of several bodies turns by itself, a body with a mirror plane in this plane only.

    before : (nodes, dim) where its nodes were when the velocities were found, mm
    """
    workpiece, nodes, parts = body.workpiece, body.nodes, body.parts
    free = np.flatnonzero(highest(nodes.comm, workpiece.held().any(axis=0).astype(float)) == 0)
    if workpiece.is_cold or len(free) < 2:
        return
    velocity, moved = workpiece.velocity[:, free], (body.x - before)[:, free]
    own = np.arange(nodes.count) < nodes.mesh.geometry.index_map().size_local
    of_node = np.zeros(nodes.count, int) if parts is None else parts.of_node
    change = np.zeros_like(velocity)
    for number in range(1 if parts is None else len(parts.counts)):
        mine = of_node == number
        spin = _spin(nodes.comm, before[mine & own][:, free], velocity[mine & own])
        change[mine] = moved[mine] @ spin.T
    workpiece.solution.x.array[workpiece.velocity_dofs[:, free]] += change


def _spin(comm, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    r"""Skew W (axes, axes), 1/s, of the rigid motion nearest to the velocities v at x (n, axes). Collective.

    By least squares over the nodes: :math:`W A + A W = B - B^T` with :math:`A=\sum r r^T`, :math:`B=\sum w r^T`, r and w
    being places and velocities about their means.
    """
    count = x.shape[1]
    sums = total(comm, np.concatenate([[len(x)], x.sum(axis=0), v.sum(axis=0)]))
    r, w = x - sums[1:1 + count] / sums[0], v - sums[1 + count:] / sums[0]
    A, B = total(comm, np.stack([r.T @ r, w.T @ r]))
    values, axes = np.linalg.eigh(A)
    odd = axes.T @ (B - B.T) @ axes
    return axes @ (odd / (values[:, None] + values)) @ axes.T
