"""Sides of a plane boundary that cross, walls that face each other, narrow notches: compiled by numba."""

from __future__ import annotations

import numpy as np

from ..machine_code import compiled

FACING = 0.7       # cosine between the way across and the normals of both walls of a thin part, at least


@compiled
def meetings(start, end, touch):
    """Pairs i < j, (p, 2), of the segments from start to end, (f, 2) each, that cross or touch, within ``touch`` of their
    lengths: those whose circles do so along the first axis are compared."""
    middle, radius = 0.5 * (start + end), 0.5 * np.sqrt((end[:, 0] - start[:, 0]) ** 2 + (end[:, 1] - start[:, 1]) ** 2)
    first = middle[:, 0] - radius
    order = np.argsort(first)
    pairs, found = np.empty((16, 2), np.int64), 0
    for p in range(len(order)):
        i = order[p]
        for q in range(p + 1, len(order)):
            j = order[q]
            if first[j] > middle[i, 0] + radius[i]:
                break
            u, v, reach = middle[j, 0] - middle[i, 0], middle[j, 1] - middle[i, 1], radius[i] + radius[j]
            if abs(v) > reach or np.sqrt(u**2 + v**2) > reach:
                continue
            if _divided(start, end, i, j, touch) and _divided(start, end, j, i, touch):
                if found == len(pairs):
                    pairs = np.concatenate((pairs, np.empty_like(pairs)))
                pairs[found, 0], pairs[found, 1] = min(i, j), max(i, j)
                found += 1
    return pairs[:found]


@compiled
def _divided(start, end, i, j, touch):
    """Whether the ends of segment j lie on different sides of the line through segment i, or one of them on it."""
    u, v = end[i, 0] - start[i, 0], end[i, 1] - start[i, 1]
    first = u * (start[j, 1] - start[i, 1]) - v * (start[j, 0] - start[i, 0])
    second = u * (end[j, 1] - start[i, 1]) - v * (end[j, 0] - start[i, 0])
    return first * second <= 0.0 or min(abs(first), abs(second)) <= touch * (u**2 + v**2)


@compiled
def nearest_walls(points, inward, s, loop, whole, reach, near):
    """Distance of points (n, 2) to the wall across the body, within ``reach`` of them; infinite without, (n,).

    inward : (n, 2) unit normals · s : (n,) arc lengths · loop : (n,) whose boundary it is, of the length ``whole`` (loops,)
    near : across counts as thin where the way around is so much longer
    """
    out, order = np.full(len(points), np.inf), np.argsort(points[:, 0])
    for p in range(len(order)):
        i = order[p]
        for q in range(p + 1, len(order)):
            j = order[q]
            u, v = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            if u > reach:
                break
            if abs(v) > reach or inward[i, 0] * inward[j, 0] + inward[i, 1] * inward[j, 1] >= -FACING:
                continue
            distance, around = np.sqrt(u**2 + v**2), np.inf
            if loop[i] == loop[j]:
                around = min(abs(s[j] - s[i]), whole[loop[i]] - abs(s[j] - s[i]))
            if distance > reach or not around > near * distance:
                continue
            if u * inward[i, 0] + v * inward[i, 1] > FACING * distance:
                out[i] = min(out[i], distance)
            if -u * inward[j, 0] - v * inward[j, 1] > FACING * distance:
                out[j] = min(out[j], distance)
    return out


@compiled
def deep_notches(start, end, along, pressed, most, deep, longest):
    """Runs of 2 to ``most`` - 1 sides (k, 2) of a loop whose way around is ``deep`` times as long as the one across, and
    shorter than ``longest``: the shorter runs first.

    along, pressed : (2 k + 1,) way, and number of pressed sides, up to each side, twice around

    Returns
    -------
    first side and number of sides of every run, (runs, 2); ways across and around, (runs, 2) mm
    """
    number = len(start)
    runs, ways, found = np.empty((16, 2), np.int64), np.empty((16, 2)), 0
    for count in range(2, most):
        for first in range(number):
            if pressed[first + count] != pressed[first]:
                continue
            last = (first + count - 1) % number
            way = along[first + count] - along[first]
            width = np.sqrt((end[last, 0] - start[first, 0]) ** 2 + (end[last, 1] - start[first, 1]) ** 2)
            if not way > deep * width or not way < longest:
                continue
            if found == len(runs):
                runs, ways = np.concatenate((runs, np.empty_like(runs))), np.concatenate((ways, np.empty_like(ways)))
            runs[found, 0], runs[found, 1], ways[found, 0], ways[found, 1] = first, count, width, way
            found += 1
    return runs[:found], ways[:found]
