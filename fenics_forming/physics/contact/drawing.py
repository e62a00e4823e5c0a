"""Clipping of segments (2D) and triangles (3D) to a box: what a picture shows of an infinite tool."""

import numpy as np


def clip(vertices, cells, low, high):
    """Part of segments or triangles that lies in a box.

    Parameters
    ----------
    vertices : array (v, d)
        Vertices in mm.
    cells : int array (m, d)
        Segments (d = 2) or triangles (d = 3) as rows of vertex numbers.
    low, high : array (d,)
        Corners of the box in mm.

    Returns
    -------
    vertices : array (k, d)
    cells : int array (n, d)
        Triangles keep their sense of winding. Nothing is copied when all lies inside the box.
    """
    low, high = np.asarray(low, float), np.asarray(high, float)
    dimension = len(low)
    if len(cells) == 0 or ((vertices >= low) & (vertices <= high)).all():
        return vertices, cells
    simplices = vertices[cells]
    for axis in range(dimension):
        simplices = _cut(simplices, high[axis] - simplices[:, :, axis])
        simplices = _cut(simplices, simplices[:, :, axis] - low[axis])
    return simplices.reshape(-1, dimension), np.arange(simplices.shape[0] * dimension).reshape(-1, dimension)


def arc_steps(radius, angle, low, high, most=20000):
    """Number of chords of an arc whose rise stays below 2e-4 of the box diagonal, rise = r a²/8."""
    rise = 2e-4 * np.linalg.norm(np.subtract(high, low))
    step = np.sqrt(8 * rise / radius)
    return int(np.clip(np.ceil(abs(angle) / step), max(2, np.ceil(abs(angle) / 0.1)), most))


def _cut(simplices, height):
    """Part of the simplices (m, d, d) where the vertex heights (m, d) are not negative."""
    dimension = height.shape[1]
    inside = height >= 0
    count = inside.sum(1)
    parts = [simplices[count == dimension]]
    for kept in range(1, dimension):
        chosen = count == kept
        # turn each simplex so that its lone vertex (the one inside, or the one outside) comes first
        lone = np.argmax(inside[chosen] == (kept == 1), axis=1)
        turned = (lone[:, None] + np.arange(dimension)) % dimension
        x = np.take_along_axis(simplices[chosen], turned[:, :, None], axis=1)
        h = np.take_along_axis(height[chosen], turned, axis=1)
        share = h[:, :1] / (h[:, :1] - h[:, 1:])
        crossing = x[:, :1] + share[:, :, None] * (x[:, 1:] - x[:, :1])
        if kept == 1:
            parts.append(np.concatenate([x[:, :1], crossing], axis=1))
        else:
            p, q = crossing[:, 0], crossing[:, 1]
            parts += [np.stack([p, x[:, 1], x[:, 2]], axis=1), np.stack([p, x[:, 2], q], axis=1)]
    return np.concatenate(parts)
