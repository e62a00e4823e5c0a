"""Folds of a plane boundary: where it crosses itself, the loop beyond the crossing is cut off; narrow notches are filled.

A free surface that folds and overlaps itself would press on itself; self-contact is not modelled, and no engine can mesh
a boundary that crosses itself. So the two walls are joined where they cross, and the overlap is lost (to be given back by
volume constancy).
"""

from __future__ import annotations

import numpy as np

from ...errors import MeshError
from .boundary_kernels import deep_notches
from .crossing import crossings

MOST = 0.2          # of the length of a loop of the boundary: a longer one is no fold, the body itself is tangled
ATTEMPTS = 50       # folds of one loop
TINY = 1e-9         # of the mouth
DEEP = 1.5          # way around a notch over its mouth; around a corner of 90° it is 1.41
SPAN = 40           # sides of a notch at most
SHORTEST = 0.1      # of the mean side: a piece of side up to the crossing that is shorter is left out


def healed(x: np.ndarray, loop: np.ndarray, labels: np.ndarray
           ) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
    """A loop of sides, (k, 3) start, end and middle, with its labels (k,), free of folds; new points are appended to x.
    The last of the four are the places, mm, where folds have been cut off.

    Raises
    ------
    MeshError
        if more than a fold would have to be cut off.
    """
    places = []
    for _ in range(ATTEMPTS):
        found = _shortest_fold(x, loop)
        if found is None:
            return x, loop, labels, places
        first, last, place = found
        places.append(place)
        x, loop, labels = _without(x, loop, labels, first, last, place)
    raise MeshError("the body could not be meshed anew: its boundary crosses itself in too many places")


def _shortest_fold(x, loop):
    """First and last side, in turn, of the fold with the shortest way round, and where it crosses itself; None."""
    start, end, middle = (x[loop[:, k]] for k in range(3))
    a = np.stack([start, middle], axis=1).reshape(-1, 2)
    b = np.stack([middle, end], axis=1).reshape(-1, 2)
    i, j = crossings(a, b)
    if len(i) == 0:
        return None
    length = np.linalg.norm(b - a, axis=1)
    along = np.concatenate([[0.0], np.cumsum(length)])
    between = along[j] - along[i + 1]
    around = along[-1] - between - length[i] - length[j]
    k = int(np.argmin(np.minimum(between, around)))
    if min(between[k], around[k]) > MOST * along[-1]:
        place = ", ".join(f"{c:.6g}" for c in a[i[k]])
        raise MeshError(f"the body could not be meshed anew: its boundary crosses itself at ({place}) mm")
    first, last = (i[k], j[k]) if between[k] <= around[k] else (j[k], i[k])
    return int(first) // 2, int(last) // 2, _meeting(a[first], b[first], a[last], b[last])


def bridged(x: np.ndarray, loop: np.ndarray, labels: np.ndarray, detail
            ) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
    """The same without notches of the free surface whose mouth is narrower than ``detail``, a function of points in mm.

    No mesh of that fineness follows them; a straight side across the mouth takes the place of their walls. So do the
    acute edges of lips below a tool go. The last of the four are the places of the mouths, mm.
    """
    places = []
    for _ in range(ATTEMPTS):
        found = _deepest_notch(x, loop, labels, detail)
        if found is None:
            break
        first, count = found
        inside = (first + np.arange(count)) % len(loop)
        begin, finish = loop[inside[0], 0], loop[inside[-1], 1]
        kept = (inside[-1] + 1 + np.arange(len(loop) - count)) % len(loop)
        middle = 0.5 * (x[begin] + x[finish])
        places.append(middle)
        loop = np.concatenate([loop[kept], np.array([[begin, finish, len(x)]], dtype=loop.dtype)])
        x, labels = np.concatenate([x, middle[None]]), np.append(labels[kept], labels[first])
    return x, loop, labels, places


def _deepest_notch(x, loop, labels, detail):
    """First side and number of sides of the notch with the longest way around more than across; None."""
    start, middle = x[loop[:, 0]], x[loop[:, 2]]
    length = np.linalg.norm(middle - start, axis=1) + np.linalg.norm(x[loop[:, 1]] - middle, axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.tile(length, 2))])
    pressed = np.concatenate([[0], np.cumsum(np.tile(labels != 0, 2))])
    most = min(SPAN, len(loop) // 2)
    runs, ways = deep_notches(start, x[loop[:, 1]], along, pressed, most, DEEP, MOST * along[len(loop)])
    if len(runs):
        narrow = ways[:, 0] < detail(start[runs[:, 0]])
        runs, ways = runs[narrow], ways[narrow]
    for k in np.argsort(ways[:, 0] - ways[:, 1], kind="stable"):
        first, sides = runs[k].tolist()
        inside = loop[(first + np.arange(sides)) % len(loop)]
        walls, (u, v) = x[inside][:, 1:].reshape(-1, 2) - start[first], x[inside[-1, 1]] - start[first]
        if (u * walls[:, 1] - v * walls[:, 0] >= -TINY * ways[k, 0] ** 2).all():
            return first, sides
    return None


def _meeting(a, b, p, q):
    """Where the lines through a, b and through p, q meet, within the first; its middle where they are parallel."""
    system = np.column_stack([b - a, p - q])
    s = 0.5 if abs(np.linalg.det(system)) < 1e-12 * np.linalg.norm(b - a) * np.linalg.norm(q - p) \
        else np.clip(np.linalg.solve(system, p - a)[0], 0.0, 1.0)
    return a + s * (b - a)


def _without(x, loop, labels, first, last, place):
    """The loop without the sides from ``first`` to ``last``, whose outer ends are joined over ``place``."""
    count = len(loop)
    kept = (last + 1 + np.arange((first - last - 1) % count)) % count
    begin, finish = int(loop[first, 0]), int(loop[last, 1])
    shortest = SHORTEST * np.linalg.norm(x[loop[:, 1]] - x[loop[:, 0]], axis=1).mean()
    far = [np.linalg.norm(x[node] - place) > shortest for node in (begin, finish)]
    at = len(x) if all(far) else finish if far[0] else begin
    ways = [(begin, at, labels[first]), (at, finish, labels[last])]
    ways = [way for way in ways if way[0] != way[1]]
    if not far[0] and not far[1]:
        ways = [(begin, finish, labels[first])]
    new = [place] if all(far) else []
    position = np.concatenate([x, np.reshape(new, (-1, 2))])
    middles = [0.5 * (position[a] + position[b]) for a, b, _ in ways]
    numbers = len(position) + np.arange(len(ways))
    sides = np.array([[a, b, m] for (a, b, _), m in zip(ways, numbers, strict=True)], dtype=loop.dtype)
    return (np.concatenate([position, np.reshape(middles, (-1, 2))]), np.concatenate([loop[kept], sides]),
            np.concatenate([labels[kept], [label for *_, label in ways]]))
