"""The outline of several closed plane shapes that lie side by side: an assembled tool as workpieces meet it."""

import numpy as np

from .outline import corner_turns
from .shapes import Polygon

SAME = 1e-6         # of the size of all: corners that are nearer to one another, or to a side, are on it
STRAIGHT = 1e-6     # a corner that turns less, in radian, is none


def joined(shapes):
    """The polygon around shapes that share sides, or None: they leave gaps or holes, overlap, or are no plane outlines.

    Sides are cut at the corners of the others that lie on them; what two shapes have in common, one way and the other, is
    inside; the rest is the outline.
    """
    if not shapes or not all(hasattr(shape, "corners") for shape in shapes):
        return None
    corners = [np.asarray(shape.corners, float) for shape in shapes]
    every = np.concatenate(corners)
    slack = SAME * np.ptp(every, axis=0).max()
    near = (np.abs(every[:, None] - every).max(axis=2) < slack).argmax(axis=1)      # the first of each place
    places = every[np.unique(near)]
    radius, steps = {}, []
    for shape, outline in zip(shapes, corners, strict=True):
        walk = [place for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True)
                for place in _along(a, b, places, slack)]
        steps += zip(walk, np.roll(walk, -1), strict=True)
        for corner, rounding in zip(outline, shape.radii, strict=True):
            radius.setdefault(_nearest(corner, places), []).append(float(rounding))
    outer = {(a, b) for a, b in steps if (b, a) not in steps}
    following = dict(outer)
    if len(following) < len(outer) or len(set(following.values())) < len(outer):
        return None                 # shapes that meet in a corner alone
    loop = [next(iter(following))]
    while (place := following[loop[-1]]) != loop[0]:
        loop.append(place)
    if len(loop) < len(following):
        return None
    turns = corner_turns(places[loop], closed=True)
    kept = [place for place, turn in zip(loop, turns, strict=True) if abs(turn) > STRAIGHT]
    radii = [radius[place][0] if len(radius[place]) == 1 else 0.0 for place in kept]
    return Polygon(points=places[kept].tolist(), fillet=radii if any(radii) else 0.0)


def _along(a, b, places, slack):
    """Numbers of the places on the way from ``a`` to ``b``, in its order, without the last."""
    way = b - a
    length = np.hypot(*way)
    at = (places - a) @ way / length
    across = (places - a) @ np.array([-way[1], way[0]]) / length
    on = np.flatnonzero((np.abs(across) < 2 * slack) & (at > -2 * slack) & (at < length - 2 * slack))
    return on[np.argsort(at[on])].tolist()


def _nearest(point, places):
    return int(np.argmin(((places - point) ** 2).sum(axis=1)))
