"""The boundary of a plane body as loops of chains: runs of sides between features that stay exactly where they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import MeshError
from .body_arrays import BodyArrays
from .healing import healed

ROUNDING = 1e-12       # of the body: a mirror plane so near to the origin goes through it


@dataclass(frozen=True)
class Chain:
    """A run of sides with one label and no corner inside.

    Attributes
    ----------
    points : (2 k + 1, 2) vertices and mid-nodes of its k sides in turn, body on the left, mm
    nodes : (2 k + 1,) their numbers in the body
    label : of all its sides
    closed : it is a whole loop without any feature
    """

    points: np.ndarray
    nodes: np.ndarray
    label: int
    closed: bool


def loops(body: BodyArrays, labels: np.ndarray, corner_angle: float, detail: float = 0.0) -> list[list[Chain]]:
    """The closed loops of the boundary, free of folds, each cut into its chains.

    A chain ends where the label changes and where the sides turn by more than `corner_angle` (degrees), measured
    between the end tangents of their parabolas; of corners that are nearer to each other than ``detail``, mm, along
    the boundary, the sharpest stays.

    Raises
    ------
    MeshError
        when two parts of the boundary touch in a node.
    """
    x, sides, labels = on_mirror_planes(body.x, body.sides, labels), body.sides, np.asarray(labels)
    return [_chains(*healed(x, sides[loop], labels[loop]), corner_angle, len(x), detail) for loop in _walk(body.x, sides)]


def on_mirror_planes(x: np.ndarray, sides: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """The nodes with those on mirror planes put exactly there (a copy): what rounding moved is no feature."""
    x = x.copy()
    for label in np.unique(labels[labels < 0]):
        axis, nodes = -1 - label, sides[labels == label].ravel()
        plane = np.median(x[nodes, axis])
        x[nodes, axis] = 0.0 if abs(plane) < ROUNDING * np.ptp(x[:, axis]) else plane
    return x


def _walk(x: np.ndarray, sides: np.ndarray) -> list[np.ndarray]:
    """Numbers of the sides of each loop, in turn."""
    starts, first = np.unique(sides[:, 0], return_index=True)
    if len(starts) < len(sides):
        count = np.bincount(sides[:, 0])
        place = ", ".join(f"{c:.6g}" for c in x[np.argmax(count)])
        raise MeshError(f"the body is pinched: two parts of its boundary touch at ({place}) mm")
    following = first[np.searchsorted(starts, sides[:, 1])].tolist()
    # following a boundary has no vector form; there are far fewer sides than cells
    left, found = set(range(len(sides))), []
    for side in range(len(sides)):
        loop = []
        while side in left:
            left.discard(side)
            loop.append(side)
            side = following[side]
        if loop:
            found.append(np.array(loop))
    return found


def _chains(x: np.ndarray, sides: np.ndarray, labels: np.ndarray, corner_angle: float,
            known: int, detail: float) -> list[Chain]:
    """One loop, cut at its features; without any it is one closed chain. Nodes from ``known`` on are not of the body."""
    start, end, middle = (x[sides[:, k]] for k in range(3))
    leaving, arriving = 4 * middle - 3 * start - end, start - 4 * middle + 3 * end      # end tangents of the parabolas
    turn = angle_between(np.roll(arriving, 1, axis=0), leaving)
    corner = np.where(np.abs(turn) > np.radians(corner_angle), np.abs(turn), 0.0)
    corner[labels != np.roll(labels, 1)] = np.inf
    feature = _sharpest(corner, np.linalg.norm(end - start, axis=1), detail)
    closed = not feature.any()
    first = np.flatnonzero(feature) if not closed else np.array([0])
    chains = []
    for begin, beyond in zip(first, np.append(first[1:], first[0] + len(sides)), strict=True):
        run = sides[np.arange(begin, beyond) % len(sides)]
        nodes = np.append(run[:, [0, 2]].ravel(), run[-1, 1])
        chains.append(Chain(x[nodes], _known(nodes, known), int(labels[begin]), closed))
    return chains


def _sharpest(corner: np.ndarray, length: np.ndarray, detail: float) -> np.ndarray:
    """Which of the corners at the starts of the sides, (k,) with their turn, stay: no sharper one within ``detail``."""
    place = np.cumsum(length) - length
    stays = corner > 0.0
    for k in np.flatnonzero(stays)[np.argsort(corner[stays], kind="stable")]:     # there are a few in all
        away = np.abs(place - place[k])
        near = stays & (np.minimum(away, length.sum() - away) < detail)
        near[k] = False
        stays[k] = np.isinf(corner[k]) or not near.any()
    return stays


def _known(nodes: np.ndarray, known: int) -> np.ndarray:
    """The nodes of a chain, the one before (at its start the one after) in place of those that the body does not have."""
    own = np.flatnonzero(nodes < known)
    return nodes[own[np.maximum(np.searchsorted(own, np.arange(len(nodes)), "right") - 1, 0)]]


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Signed angle from the vectors a to b, (k, 2) each, radians."""
    return np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
