"""Element sizes for a body in the middle of its process: those of its shape, and those that its flow asks for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...physics.remeshing.body_arrays import BodyArrays
from ...physics.sizes import AtNodes, AtPoints, Sizes, body_sizes, nodal_sizes

SHARE = 0.2             # of the range of a field that an element may span, at strength 1
# Of the mesh size, where contact with friction ends. The element there rolls onto the tool and misstates the force the more
# the larger it is: in the rings a new mesh changed it by up to 1.3 % with 0.35, 0.5 % with 0.2. Where the body sticks, no
# slip softens the singularity: in the billet at 60 to 70 % it was 0.9 % with 0.2, 0.4 % with 0.1. With slip as
# fine an end wears out so fast that a ring is remeshed at every second step, to no avail.
EDGE_SIZE = {False: 0.2, True: 0.1}     # by whether the body sticks
SPREAD = 0.02           # of the volume at either end that does not count in the range: peaks at singular points
FINEST = 0.25           # of the mesh size, for gradients where the scene gives no min_size


def adapted_sizes(scene, tools, body: BodyArrays, labels: np.ndarray, mirrors: dict[int, float], mesh_size: float, *,
                  strain_rate: np.ndarray | None = None, temperature: np.ndarray | None = None) -> Sizes:
    """Sizes for the next mesh of a body that is to be remeshed; on one rank.

    Parameters
    ----------
    scene : its workpiece has ``remesh``
    tools : known tools, at their places of now
    labels : (f,) of ``body.sides``: 0 free, k >= 1 pressed by the k-th tool, below 0 on a mirror plane
    mirrors : axis to coordinate of the mirror planes, the axis of rotation included
    mesh_size : mm, as `physics.bodies.body_mesh` gave it
    strain_rate : effective, at the nodes, (n,) 1/s; temperature : at the nodes, (n,). Read if ``remesh`` names them
    """
    remesh = scene.workpiece.remesh
    base = mesh_size if remesh.max_size is None else remesh.max_size
    sizes = body_sizes(scene, tools, body, mirrors, base)
    for sticks, share in EDGE_SIZE.items():
        edges = contact_edges(body, labels, [tool.has_friction and tool.friction.sticks == sticks for tool in tools])
        if len(edges):
            sizes = sizes.and_also(AtPoints(edges, max(share * base, sizes.least), sizes.growth, base))
    finest = FINEST * base if remesh.min_size is None else remesh.min_size
    also = [np.maximum(gradient_sizes(body, field, strength), finest)
            for field, strength in ((strain_rate, remesh.strain_rate), (temperature, remesh.temperature))
            if field is not None and strength is not None]
    nodal = nodal_sizes(sizes, body, mirrors, thin=True, also=also)
    return replace(sizes.and_also(AtNodes(body, nodal)), nodal=nodal)       # graded: nothing is smaller at the vertices


def gradient_sizes(body: BodyArrays, field: np.ndarray, strength: float) -> np.ndarray:
    """Sizes at the vertices, (n,) mm, with which no element spans much of the range of a field.

        h = 0.2 / strength * (range of f) / |grad f|

    with the gradient averaged around each vertex by volume, and the range between the values that 2 % of the volume
    fall below and 2 % exceed. Large (not inf) where the field is even; inf at mid-nodes.
    """
    cells = body.cells[:, : body.dim + 1]
    corners, values = body.x[cells], field[cells]
    edges = corners[:, 1:] - corners[:, :1]
    volume = np.abs(np.linalg.det(edges))
    slope = np.linalg.norm(np.linalg.solve(edges, (values[:, 1:] - values[:, :1])[..., None])[..., 0], axis=1)
    weight = np.bincount(cells.ravel(), np.repeat(volume, body.dim + 1), len(body.x))
    sum_ = np.bincount(cells.ravel(), np.repeat(volume * slope, body.dim + 1), len(body.x))
    vertices = np.flatnonzero(weight)
    low, high = _range(field[vertices], weight[vertices])
    size = np.full(len(body.x), np.inf)
    mean = sum_[vertices] / weight[vertices]
    size[vertices] = SHARE / strength * (high - low) / np.maximum(mean, 1e-30 + 1e-12 * mean.max())
    if high <= low:      # an even field asks for nothing
        size[vertices] = np.inf
    return size


def contact_edges(body: BodyArrays, labels: np.ndarray, rough: list[bool]) -> np.ndarray:
    """Points (k, 2) of a plane body where the contact with a tool with friction ends: the flow is singular there."""
    if body.dim == 3 or not any(rough):
        return np.empty((0, body.dim))      # in space a line of points, which would take most of the elements
    pressed, free = np.zeros((2, len(body.x)), dtype=bool)
    pressed[body.sides[np.append(False, rough)[np.maximum(labels, 0)], :2]] = True
    free[body.sides[labels == 0, :2]] = True
    return body.x[pressed & free]


def _range(values, weight):
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weight[order])
    return values[order][np.searchsorted(below, np.array([SPREAD, 1 - SPREAD]) * below[-1])]
