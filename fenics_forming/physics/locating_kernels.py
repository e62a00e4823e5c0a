"""Walks of points through the cells of an order-2 simplex mesh, compiled by numba: one point after the other."""

from __future__ import annotations

import numpy as np

from .machine_code import compiled

ROUND_OFF = 1e-12     # a barycentric coordinate above minus this is inside
ACROSS = 1e-9         # beyond its curved facet by more than this a point is in the next cell
MOST_CELLS = 200      # on a walk; the nearest centroid is one to three cells away, unless sizes differ wildly
TURNS = 12            # Newton steps, and changes of the cell, in the curved cells
NEGLIGIBLE = 1e-8     # a Newton step after which what is left is its square: round-off
TINY = 1e-150         # a determinant below: the cell is flat, and just holds no point


@compiled
def across_mids(mids, count):
    """The cell across each side of plane cells with mid-nodes (m, 3), of ``count`` nodes; -1 on the boundary, (m, 3)."""
    across, first = np.full(mids.shape, -1), np.full(count, -1)
    for cell in range(len(mids)):
        for side in range(3):
            mid = mids[cell, side]
            if first[mid] < 0:
                first[mid] = 3 * cell + side
            else:
                across[cell, side] = first[mid] // 3
                across[first[mid] // 3, first[mid] % 3] = cell
    return across


@compiled
def in_straight(origin, gradients, cell, point, inner):
    """Barycentric coordinates of a point in a straight cell, put into ``inner``; the least of them."""
    inner[0] = 1.0
    for i in range(len(point)):
        local = 0.0
        for j in range(len(point)):
            local += gradients[cell, i, j] * (point[j] - origin[cell, j])
        inner[i + 1] = local
        inner[0] -= local
    return inner.min()


@compiled
def way_on(across, inner):
    """Side of the most negative coordinate behind which there is a cell (of the first side if there is none)."""
    best, least = 0, np.inf
    for i in range(len(inner)):
        if across[i] >= 0 and inner[i] < least:
            best, least = i, inner[i]
    return best


@compiled
def walks(origin, gradients, neighbours, points, start):
    """From the start cells (p,) towards the points (p, dim) through straight cells, along the boundary where it bars the
    way: the cell where each walk ends, (p,), and the coordinates there, (p, dim + 1)."""
    cells, inner = start.astype(np.int64), np.empty((len(points), points.shape[1] + 1))
    for p in range(len(points)):
        least = in_straight(origin, gradients, cells[p], points[p], inner[p])
        for _ in range(MOST_CELLS):
            if least >= -ROUND_OFF:
                break
            side = way_on(neighbours[cells[p]], inner[p])
            if neighbours[cells[p], side] < 0 or inner[p, side] >= -ROUND_OFF:
                break
            cells[p] = neighbours[cells[p], side]
            least = in_straight(origin, gradients, cells[p], points[p], inner[p])
    return cells, inner


@compiled
def clip(inner):
    """Clip barycentric coordinates to the simplex, in place: none negative, sum 1."""
    whole = 0.0
    for i in range(len(inner)):
        inner[i] = max(inner[i], 0.0)
        whole += inner[i]
    for i in range(len(inner)):
        inner[i] = inner[i] / whole if whole > 0.0 else 1.0 / len(inner)


@compiled
def clipped(x, vertices, points, cells, inner):
    """The coordinates (p, dim + 1) in straight cells (p,) clipped to these, and how far that is from the points, (p,)."""
    inner, distance = inner.copy(), np.empty(len(points))
    for p in range(len(points)):
        clip(inner[p])
        squares = 0.0
        for j in range(points.shape[1]):
            place = 0.0
            for i in range(inner.shape[1]):
                place += inner[p, i] * x[vertices[cells[p], i], j]
            squares += (place - points[p, j]) ** 2
        distance[p] = np.sqrt(squares)
    return inner, distance


@compiled
def means(nodal, vertices, cells, inner):
    """Means (p,) of nodal values (n,) at the vertices of cells (p,), weighted by the clipped coordinates (p, dim + 1)."""
    out = np.zeros(len(cells))
    for p in range(len(cells)):
        clip(inner[p])
        for i in range(inner.shape[1]):
            out[p] += inner[p, i] * nodal[vertices[cells[p], i]]
    return out


@compiled
def map_at(x, nodes, edges, inner, place, slope):
    """Where coordinates lie in a curved cell, put into ``place`` (dim,), and the derivatives by each of them, into
    ``slope`` (dim + 1, dim)."""
    corners, dim = len(inner), len(place)
    if dim == 2:        # written out: twice as fast
        for j in range(2):
            a, b, c = inner[0], inner[1], inner[2]
            u, v, w = 4 * x[nodes[3], j], 4 * x[nodes[4], j], 4 * x[nodes[5], j]        # across from a, b, c
            place[j] = a * (2 * a - 1) * x[nodes[0], j] + b * (2 * b - 1) * x[nodes[1], j] \
                + c * (2 * c - 1) * x[nodes[2], j] + b * c * u + a * c * v + a * b * w
            slope[0, j] = (4 * a - 1) * x[nodes[0], j] + c * v + b * w
            slope[1, j] = (4 * b - 1) * x[nodes[1], j] + c * u + a * w
            slope[2, j] = (4 * c - 1) * x[nodes[2], j] + b * u + a * v
        return
    for j in range(dim):
        place[j] = 0.0
        for i in range(corners):
            place[j] += inner[i] * (2 * inner[i] - 1) * x[nodes[i], j]
            slope[i, j] = (4 * inner[i] - 1) * x[nodes[i], j]
        for k in range(len(edges)):
            a, b = edges[k, 0], edges[k, 1]
            middle = 4 * x[nodes[corners + k], j]
            place[j] += inner[a] * inner[b] * middle
            slope[a, j] += inner[b] * middle
            slope[b, j] += inner[a] * middle


@compiled
def distances(x, cells, edges, points, chosen, inner):
    """How far the points (p, dim) are from the coordinates (p, dim + 1) in the curved cells ``chosen`` (p,), (p,)."""
    dim = points.shape[1]
    out, place, slope = np.empty(len(points)), np.empty(dim), np.empty((dim + 1, dim))
    for p in range(len(points)):
        map_at(x, cells[chosen[p]], edges, inner[p], place, slope)
        squares = 0.0
        for j in range(dim):
            squares += (place[j] - points[p, j]) ** 2
        out[p] = np.sqrt(squares)
    return out


@compiled
def solved(matrix, right, out):
    """Solution of a system of one to three equations by Cramer's rule, put into ``out``."""
    n = len(right)
    if n == 1:
        out[0] = right[0] / (matrix[0, 0] if abs(matrix[0, 0]) > TINY else TINY)
        return
    if n == 2:
        det = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
        det = det if abs(det) > TINY else TINY
        out[0] = (matrix[1, 1] * right[0] - matrix[0, 1] * right[1]) / det
        out[1] = (matrix[0, 0] * right[1] - matrix[1, 0] * right[0]) / det
        return
    det = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        det += matrix[0, i] * (matrix[1, j] * matrix[2, k] - matrix[1, k] * matrix[2, j])
    det = det if abs(det) > TINY else TINY
    for i in range(3):      # cofactors of the i-th column
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = 0.0
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            out[i] += right[a] * (matrix[b, j] * matrix[c, k] - matrix[b, k] * matrix[c, j])
        out[i] /= det


@compiled
def newton(x, nodes, edges, point, inner, work):
    """Coordinates of a point in a curved cell, however far outside, in place; ``work`` (2 dim + 4, dim) is overwritten.

    Newton steps are repeated until they are negligible.
    """
    dim = len(point)
    place, right, step, slope, matrix = work[0], work[1], work[2], work[3:dim + 4], work[dim + 4:]
    for _ in range(TURNS):
        map_at(x, nodes, edges, inner, place, slope)
        for i in range(dim):
            right[i] = point[i] - place[i]
            for j in range(dim):
                matrix[i, j] = slope[j + 1, i] - slope[0, i]
        solved(matrix, right, step)
        size = 0.0
        for i in range(dim):
            size = max(size, abs(step[i]))
        for i in range(dim):
            move = step[i] / max(1.0, size)         # not across the whole mesh
            inner[i + 1] += move
            inner[0] -= move
        if size <= NEGLIGIBLE:
            break


@compiled
def curved_walks(x, cells, edges, origin, gradients, neighbours, points, start, inner):
    """The curved cells that the points lie in, from straight ones that hold them, and the coordinates there.

    Where the curved side lies between a point and its cell it goes on in the cell behind that side. ``inner`` are the
    coordinates in the start cells; those that are returned are negative outside of the mesh.
    """
    ends, inner = start.astype(np.int64), inner.copy()
    work = np.empty((2 * points.shape[1] + 4, points.shape[1]))
    for p in range(len(points)):
        for _ in range(TURNS):
            clip(inner[p])
            newton(x, cells[ends[p]], edges, points[p], inner[p], work)
            side = way_on(neighbours[ends[p]], inner[p])
            if neighbours[ends[p], side] < 0 or inner[p, side] >= -ACROSS:
                break
            ends[p] = neighbours[ends[p], side]
            in_straight(origin, gradients, ends[p], points[p], inner[p])
    return ends, inner


@compiled
def on_facets(x, cells, edges, points, chosen, sides, start):
    """The nearest places to points on the facets opposite to the vertices ``sides`` (p,) of the cells ``chosen`` (p,):
    coordinates (p, dim + 1), by Gauss-Newton from ``start`` with that coordinate at zero."""
    dim = points.shape[1]
    out, free = start.copy(), np.empty(dim, np.int64)
    place, slope, before = np.empty(dim), np.empty((dim + 1, dim)), np.empty(dim + 1)
    tangents, metric = np.empty((dim - 1, dim)), np.empty((dim - 1, dim - 1))
    right, step = np.empty(dim - 1), np.empty(dim - 1)
    for p in range(len(points)):
        here, count = out[p], 0
        for i in range(dim + 1):
            if i != sides[p]:
                free[count] = i
                count += 1
        here[sides[p]] = 0.0
        clip(here)
        for _ in range(TURNS):
            map_at(x, cells[chosen[p]], edges, here, place, slope)
            whole = 0.0
            for a in range(dim - 1):
                right[a] = 0.0
                for j in range(dim):
                    tangents[a, j] = slope[free[a + 1], j] - slope[free[0], j]
                    right[a] += tangents[a, j] * (points[p, j] - place[j])
                    whole += tangents[a, j] ** 2
            for a in range(dim - 1):
                for b in range(dim - 1):
                    metric[a, b] = ROUND_OFF * max(whole, TINY) if a == b else 0.0      # a flat facet stops no one
                    for j in range(dim):
                        metric[a, b] += tangents[a, j] * tangents[b, j]
            solved(metric, right, step)
            before[:] = here
            for a in range(dim - 1):
                here[free[a + 1]] += step[a]
                here[free[0]] -= step[a]
            clip(here)
            moved = 0.0
            for i in range(dim + 1):
                moved = max(moved, abs(here[i] - before[i]))
            if moved <= NEGLIGIBLE:
                break
    return out
