"""The boundary of a plane body as loops of chains: runs of sides between features that stay exactly where they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import MeshError
from .body_arrays import BodyArrays, preceding
from .healing import bridged, healed
from .landing import Landing, landed

SAME = 1e-6            # of the body: a node so near to a place is there
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


def loops(body: BodyArrays, labels: np.ndarray, corner_angle: float, landing: Landing | None = None,
          detail=None, corners: np.ndarray | None = None) -> tuple[list[list[Chain]], list[str]]:
    """The closed loops of the boundary, mended and landed on the tools, each cut into its chains; what that changed.

    A chain ends where the label changes and where the sides turn by more than `corner_angle` (degrees), measured
    between the end tangents of their parabolas; of two corners closer to each other along the boundary than ``detail``,
    a function of points in mm, the sharper one stays, and none so close to where the label changes. Nodes at one of the
    places ``corners`` (k, 2) are corners, however blunt.

    Raises
    ------
    MeshError
        when two parts of the boundary touch in a node.
    """
    x, sides, labels = on_mirror_planes(body.x, body.sides, labels), body.sides, np.asarray(labels)
    found, changes = [], []
    for numbers, turned in _walk(body.x, sides):
        loop = sides[numbers]
        loop[turned, :2] = loop[turned, 1::-1]
        points, loop, kinds, folds = healed(x, loop, labels[numbers])
        changes += [f"a fold at ({_words(place)}) mm cut off" for place in folds]
        if detail is not None:
            points, loop, kinds, notches = bridged(points, loop, kinds, detail)
            changes += [f"a notch at ({_words(place)}) mm filled" for place in notches]
        if landing is not None:
            points, loop, kinds = landed(points, loop, kinds, landing)
        found.append(_chains(points, loop, kinds, corner_angle, len(x), detail, corners))
    return found, changes


def _words(place: np.ndarray) -> str:
    return ", ".join(f"{c:.4g}" for c in place)


def on_mirror_planes(x: np.ndarray, sides: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """The nodes with those on mirror planes put exactly there (a copy): what rounding moved is no feature."""
    x = x.copy()
    for label in np.unique(labels[labels < 0]):
        axis, nodes = -1 - label, sides[labels == label].ravel()
        plane = np.median(x[nodes, axis])
        x[nodes, axis] = 0.0 if abs(plane) < ROUNDING * np.ptp(x[:, axis]) else plane
    return x


def _walk(x: np.ndarray, sides: np.ndarray) -> list[np.ndarray]:
    """The sides of each loop, (k, 3), in turn.

    Behind an inverted cell a side has been taken for one that runs the other way: the others of its loop tell.
    """
    ends, order = sides[:, :2].ravel(), np.argsort(sides[:, :2].ravel(), kind="stable")
    count = np.bincount(ends)
    if count.max() > 2:
        place = ", ".join(f"{c:.6g}" for c in x[np.argmax(count)])
        raise MeshError(f"the body is pinched: two parts of its boundary touch at ({place}) mm")
    # the other end at the same node: of side k, at its start (2 k) and at its end (2 k + 1)
    partner = np.empty(len(ends), dtype=np.int64)
    partner[order[0::2]], partner[order[1::2]] = order[1::2], order[0::2]
    partner = partner.tolist()
    # following a boundary has no vector form; there are far fewer sides than cells
    left, found = set(range(len(sides))), []
    for side in range(len(sides)):
        loop, leaving = [], 2 * side + 1
        while leaving // 2 in left:
            left.discard(leaving // 2)
            loop.append(leaving)
            leaving = partner[leaving] ^ 1
        if loop:
            found.append(_oriented(sides, np.array(loop)))
    return found


def _oriented(sides: np.ndarray, leaving: np.ndarray) -> np.ndarray:
    """Numbers of the sides of a loop and whether each is turned, from the ends (k,) at which a way around leaves them."""
    turned = leaving % 2 == 0
    if turned.sum() > len(turned) / 2:
        leaving, turned = leaving[::-1], ~turned[::-1]
    return leaving // 2, turned


def _chains(x: np.ndarray, sides: np.ndarray, labels: np.ndarray, corner_angle: float,
            known: int, detail, corners: np.ndarray | None) -> list[Chain]:
    """One loop, cut at its features; without any it is one closed chain. Nodes from ``known`` on are not of the body."""
    start, end, middle = (x[sides[:, k]] for k in range(3))
    leaving, arriving = 4 * middle - 3 * start - end, start - 4 * middle + 3 * end      # end tangents of the parabolas
    turn = angle_between(preceding(arriving), leaving)
    sharpness = np.where(np.abs(turn) > np.radians(corner_angle), np.abs(turn), 0.0)
    if corners is not None and len(corners):
        away = np.linalg.norm(start[:, None] - corners, axis=2).min(axis=1)
        sharpness[away < SAME * np.ptp(x, axis=0).max()] = np.pi
    sharpness[labels != preceding(labels)] = np.inf
    feature = sharpness > 0.0
    if detail is not None and feature.any():
        feature[feature] = _apart(sharpness[feature], np.cumsum(np.linalg.norm(end - start, axis=1)), feature,
                                  detail(start[feature]))
    closed = not feature.any()
    first = np.flatnonzero(feature) if not closed else np.array([0])
    chains = []
    for begin, beyond in zip(first, np.append(first[1:], first[0] + len(sides)), strict=True):
        run = sides[np.arange(begin, beyond) % len(sides)]
        nodes = np.append(run[:, [0, 2]].ravel(), run[-1, 1])
        chains.append(Chain(x[nodes], _known(nodes, known), int(labels[begin]), closed))
    return chains


def _apart(sharpness: np.ndarray, along: np.ndarray, feature: np.ndarray, detail: np.ndarray) -> np.ndarray:
    """Which of the features, (k,) by their sharpness, stay; ``along`` ends the sides (n,) that start at ``feature``."""
    place, whole = np.concatenate([[0.0], along[:-1]])[feature], along[-1]
    stay = np.ones(len(place), dtype=bool)
    for k in np.argsort(sharpness, kind="stable"):         # the bluntest goes first; there are a few in all
        away = np.abs(place - place[k])
        near = stay & (np.minimum(away, whole - away) < detail[k])
        near[k] = False
        stay[k] = np.isinf(sharpness[k]) or not near.any()
    return stay


def _known(nodes: np.ndarray, known: int) -> np.ndarray:
    """The nodes of a chain, the one before (at its start the one after) in place of those that the body does not have."""
    own = np.flatnonzero(nodes < known)
    return nodes[own[np.maximum(np.searchsorted(own, np.arange(len(nodes)), "right") - 1, 0)]]


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Signed angle from the vectors a to b, (k, 2) each, radians."""
    return np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
