"""Sides of a plane boundary that cross, walls that face each other, narrow notches: compiled by numba."""

from __future__ import annotations

import numpy as np

from ..machine_code import compiled

FACING = 0.7       # cosine between the way across and the normals of both walls of a thin part, at least


@compiled
def meeting(start, end, i, j, touch):
    """Whether the segments i and j (p,) of those from start to end, (f, 2) each, cross or touch, within ``touch`` of their
    lengths, (p,)."""
    out = np.zeros(len(i), np.bool_)
    for p in range(len(i)):
        a, b = (start[i[p]], end[i[p]]), (start[j[p]], end[j[p]])
        apart = np.sqrt((b[0][0] + b[1][0] - a[0][0] - a[1][0]) ** 2 + (b[0][1] + b[1][1] - a[0][1] - a[1][1]) ** 2)
        lengths = (np.sqrt((a[1][0] - a[0][0]) ** 2 + (a[1][1] - a[0][1]) ** 2)
                   + np.sqrt((b[1][0] - b[0][0]) ** 2 + (b[1][1] - b[0][1]) ** 2))
        out[p] = apart <= lengths and _divided(a, b, touch) and _divided(b, a, touch)
    return out


@compiled
def _divided(line, ends, touch):
    """Whether two points lie on different sides of the line through two others, or one of them on it."""
    u, v = line[1][0] - line[0][0], line[1][1] - line[0][1]
    first = u * (ends[0][1] - line[0][1]) - v * (ends[0][0] - line[0][0])
    second = u * (ends[1][1] - line[0][1]) - v * (ends[1][0] - line[0][0])
    return first * second <= 0.0 or min(abs(first), abs(second)) <= touch * (u**2 + v**2)


@compiled
def nearest_walls(points, inward, s, loop, whole, pairs, near):
    """Distance of points (n, 2) to the wall across the body, over the ``pairs`` (p, 2) of them; infinite without, (n,).

    inward : (n, 2) unit normals · s : (n,) arc lengths · loop : (n,) whose boundary it is, of the length ``whole`` (loops,)
    near : across counts as thin where the way around is so much longer
    """
    out = np.full(len(points), np.inf)
    for p in range(len(pairs)):
        i, j = pairs[p, 0], pairs[p, 1]
        across = (points[j, 0] - points[i, 0], points[j, 1] - points[i, 1])
        distance = np.sqrt(across[0] ** 2 + across[1] ** 2)
        around = np.inf
        if loop[i] == loop[j]:
            around = min(abs(s[j] - s[i]), whole[loop[i]] - abs(s[j] - s[i]))
        if not around > near * distance or inward[i, 0] * inward[j, 0] + inward[i, 1] * inward[j, 1] >= -FACING:
            continue
        if across[0] * inward[i, 0] + across[1] * inward[i, 1] > FACING * distance:
            out[i] = min(out[i], distance)
        if -across[0] * inward[j, 0] - across[1] * inward[j, 1] > FACING * distance:
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
