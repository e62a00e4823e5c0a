"""Sides of a plane boundary that hover just above a tool: they land on it, and shallow pockets below it are closed.

A curved side rolls onto a tool as a whole: its middle hovers at a quarter of the height of its far end until that lands.
And where a free surface folds onto a tool, pockets far below the element size stay behind. No mesh resolves them and the
tool is about to close them; a remeshing does it, the volume is given back by volume constancy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .body_arrays import following, preceding


@dataclass(frozen=True)
class Landing:
    """What a remeshing needs to know of the tools.

    gaps : label of a tool → function of points (k, 2) to their gaps (k,), mm, and normals (k, 2) out of the tool
    height : function of points to what counts as landed there (k,), mm
    mouth : function of points to the width of the narrowest pocket that is kept there (k,), mm
    touching : what counts as touching, mm
    """

    gaps: dict[int, Callable]
    height: Callable
    mouth: Callable
    touching: float


def landed(x: np.ndarray, loop: np.ndarray, labels: np.ndarray, landing: Landing
           ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A loop of sides, (k, 3) start, end and middle, with its labels (k,), after landing; new points are appended to x.

    Free half sides are taken as pressed where both ends are low enough, the way along the tool goes forward, and they
    hang together with pressed ones or touch the tool. A free run between two pressed ones that is low all along, or whose
    ends are closer to each other than a mesh can resolve, is closed.
    """
    for label, gap in landing.gaps.items():
        x, loop, labels = _on_tool(x, loop, labels, label, gap, landing)
    return x, loop, labels


def _on_tool(x, loop, labels, label, gap, landing):
    knots, half = loop[:, [0, 2]].ravel(), np.repeat(labels, 2)
    height, normal = gap(x[knots])
    low = np.abs(height) <= landing.height(x[knots])
    at = x[knots] - height[:, None] * normal
    along = np.stack([normal[:, 1], -normal[:, 0]], axis=1)           # the way on which the body lies on the left
    forward = ((following(at) - at) * along).sum(axis=1) > 0.0
    free = (half == 0) & low & following(low) & forward
    held = (half == label)
    taken = held | _joined(free, held, np.abs(height) <= landing.touching)
    keep = np.ones(len(knots), dtype=bool)
    for first, last in _between(half == 0, taken):
        run = np.arange(first + 1, first + 1 + (last - first) % len(knots)) % len(knots)     # knots inside
        if _is_pocket(x[knots], at, low, along, run, first, (last + 1) % len(knots), landing.mouth):
            keep[run] = _advancing(at, along, run, first, (last + 1) % len(knots))
            taken[np.append(run, first)] = True
    if not (taken & ~held).any():
        return x, loop, labels
    for edge, step in _landed_ends(taken, held):
        keep[_undercut(x[knots], at[edge], along[edge], (half == 0) & ~taken, edge, step, landing.mouth)] = False
    return _rebuilt(x, loop, labels, label, taken, keep, at)


def _landed_ends(taken, held) -> list[tuple[int, int]]:
    """Knots at which what has newly landed ends, and the step, 1 or -1, to the next knot outside."""
    new, count = taken & ~held, len(taken)
    return [((k + 1) % count, 1) for k in np.flatnonzero(new & ~following(taken)).tolist()] + \
        [(k, -1) for k in np.flatnonzero(new & ~preceding(taken)).tolist()]


def _undercut(x, edge_at, along, free, edge, step, mouth) -> list[int]:
    """Knots next to a landed edge that lie behind it, below the tool, within what a mesh resolves: cells would have to fill
    an acute wedge."""
    found, width = [], mouth(edge_at[None])[0]
    for k in range(1, len(x)):
        knot = (edge + step * k) % len(x)
        beyond = (edge + step * k - (step < 0)) % len(x)       # the half side outside that knot
        behind = step * ((x[knot] - edge_at) @ along) < 0.0
        if not (free[beyond] and behind and np.linalg.norm(x[knot] - edge_at) < width):
            break
        found.append(knot)
    return found


def _joined(free: np.ndarray, held: np.ndarray, touching: np.ndarray) -> np.ndarray:
    """The runs of free half sides that follow or precede a held one, or have a touching end."""
    seeds = free & (preceding(held) | following(held) | touching | following(touching))
    while True:
        grown = free & (seeds | preceding(seeds) | following(seeds))
        if (grown == seeds).all():
            return seeds
        seeds = grown


def _between(free: np.ndarray, taken: np.ndarray) -> list[tuple[int, int]]:
    """First and last half side of every run of free ones between two taken ones."""
    free = free & ~taken
    first = np.flatnonzero(free & preceding(taken))
    last = np.flatnonzero(free & following(taken))
    found = []
    for k in first:
        end = last[np.argmin((last - k) % len(free))] if len(last) else None
        if end is not None and free[np.arange(k, k + 1 + (end - k) % len(free)) % len(free)].all():
            found.append((int(k), int(end)))
    return found


def _is_pocket(x, at, low, along, run, begin, finish, mouth) -> bool:
    """Whether a free run of knots between two on the tool is to be closed: it is low, or narrow and on the body's side."""
    way = at[finish] - at[begin]
    if (way * along[begin]).sum() <= 0.0:
        return False
    off = x[run] - at[begin]
    inside = way[0] * off[:, 1] - way[1] * off[:, 0] >= 0.0
    return bool(low[run].all() or (inside.all() and way @ way < mouth(at[[begin]])[0] ** 2))


def _advancing(at, along, run, begin, finish) -> np.ndarray:
    """The knots of a run whose places on the tool go forward from its begin to its end."""
    keep, here = np.zeros(len(run), dtype=bool), at[begin]
    for k, knot in enumerate(run):
        step, rest = at[knot] - here, at[finish] - at[knot]
        if (step * along[knot]).sum() > 0.0 and (rest * along[knot]).sum() > 0.0:
            keep[k], here = True, at[knot]
    return keep


def _rebuilt(x, loop, labels, label, taken, keep, at):
    """The loop with the knots of taken half sides on the tool and without those that are not kept."""
    knots = loop[:, [0, 2]].ravel()
    x = x.copy()
    on_tool = taken | preceding(taken)
    x[knots[on_tool]] = at[on_tool]
    half = np.where(taken, label, np.repeat(labels, 2))
    whole = keep[0::2] & keep[1::2] & following(keep)[1::2] & (half[0::2] == half[1::2])
    sides, kinds, fresh, count = [], [], [], len(x)
    kept = np.flatnonzero(keep)
    beyond = dict(zip(kept.tolist(), following(kept).tolist(), strict=True))
    for k in kept.tolist():
        if whole[k // 2]:
            if k % 2 == 0:
                sides.append(loop[k // 2])
                kinds.append(half[k])
            continue
        a, b = knots[k], knots[beyond[k]]
        sides.append((a, b, count + len(fresh)))
        straight = half[k] == label or beyond[k] != (k + 1) % len(knots)
        fresh.append(0.5 * (x[a] + x[b]) if straight else _quarter(x, loop[k // 2], k % 2))
        kinds.append(half[k])
    return (np.concatenate([x, np.reshape(fresh, (-1, 2))]), np.array(sides, dtype=loop.dtype),
            np.array(kinds, dtype=labels.dtype))


def _quarter(x, side, second):
    """A quarter or three quarters of the way along the parabola of a side."""
    a, b, m = x[side]
    return 0.375 * (b if second else a) - 0.125 * (a if second else b) + 0.75 * m
