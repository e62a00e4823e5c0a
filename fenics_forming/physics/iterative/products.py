"""Products with symmetric block matrices of which the upper half is stored, compiled by numba."""

from __future__ import annotations

from ..machine_code import compiled


@compiled
def product(starts, columns, diagonal, upper, x, y):
    """y = A x for blocks of 3 x 3: diagonal (n, 9), upper (m, 9) with ``columns`` (m,), row i from ``starts[i]`` on."""
    y[:] = 0.0
    for i in range(len(starts) - 1):
        _add_row(i, starts[i], starts[i + 1], columns, diagonal[i], upper, x, y)


@compiled
def add_product_of_some(rows, starts, columns, diagonal, upper, x, y):
    """Add A x to y for a matrix A over some ``rows`` (n,) of them only, which its ``columns`` name too."""
    for r in range(len(rows)):
        _add_row(rows[r], starts[r], starts[r + 1], columns, diagonal[r], upper, x, y)


@compiled
def _add_row(i, begin, end, columns, d, upper, x, y):
    x0, x1, x2 = x[i, 0], x[i, 1], x[i, 2]
    s0 = d[0] * x0 + d[1] * x1 + d[2] * x2
    s1 = d[3] * x0 + d[4] * x1 + d[5] * x2
    s2 = d[6] * x0 + d[7] * x1 + d[8] * x2
    for k in range(begin, end):
        j, b = columns[k], upper[k]
        z0, z1, z2 = x[j, 0], x[j, 1], x[j, 2]
        s0 += b[0] * z0 + b[1] * z1 + b[2] * z2
        s1 += b[3] * z0 + b[4] * z1 + b[5] * z2
        s2 += b[6] * z0 + b[7] * z1 + b[8] * z2
        y[j, 0] += b[0] * x0 + b[3] * x1 + b[6] * x2
        y[j, 1] += b[1] * x0 + b[4] * x1 + b[7] * x2
        y[j, 2] += b[2] * x0 + b[5] * x1 + b[8] * x2
    y[i, 0] += s0
    y[i, 1] += s1
    y[i, 2] += s2


@compiled
def scalar_product(starts, columns, diagonal, upper, x, y):
    """y = M x for numbers instead of blocks."""
    y[:] = 0.0
    for i in range(len(starts) - 1):
        s = diagonal[i] * x[i]
        for k in range(starts[i], starts[i + 1]):
            j = columns[k]
            s += upper[k] * x[j]
            y[j] += upper[k] * x[i]
        y[i] += s


@compiled
def rows_times(starts, columns, blocks, x, y):
    """y = B x: (vertices,) from (nodes, 3)."""
    for i in range(len(starts) - 1):
        s = 0.0
        for k in range(starts[i], starts[i + 1]):
            j, b = columns[k], blocks[k]
            s += b[0] * x[j, 0] + b[1] * x[j, 1] + b[2] * x[j, 2]
        y[i] = s


@compiled
def both_times(starts, columns, blocks, x, q, y, z):
    """z = B x and y = B^T q at once: (vertices,) and (nodes, 3) from (nodes, 3) and (vertices,)."""
    y[:] = 0.0
    for i in range(len(starts) - 1):
        s, given = 0.0, q[i]
        for k in range(starts[i], starts[i + 1]):
            j, b = columns[k], blocks[k]
            s += b[0] * x[j, 0] + b[1] * x[j, 1] + b[2] * x[j, 2]
            y[j, 0] += b[0] * given
            y[j, 1] += b[1] * given
            y[j, 2] += b[2] * given
        z[i] = s


@compiled
def columns_times(starts, columns, blocks, x, y):
    """y = B^T x: (nodes, 3) from (vertices,)."""
    y[:] = 0.0
    for i in range(len(starts) - 1):
        s = x[i]
        for k in range(starts[i], starts[i + 1]):
            j, b = columns[k], blocks[k]
            y[j, 0] += b[0] * s
            y[j, 1] += b[1] * s
            y[j, 2] += b[2] * s


@compiled
def apply_blocks(blocks, x, y):
    """y = D x for a block diagonal (n, 9)."""
    for i in range(len(blocks)):
        d = blocks[i]
        x0, x1, x2 = x[i, 0], x[i, 1], x[i, 2]
        y[i, 0] = d[0] * x0 + d[1] * x1 + d[2] * x2
        y[i, 1] = d[3] * x0 + d[4] * x1 + d[5] * x2
        y[i, 2] = d[6] * x0 + d[7] * x1 + d[8] * x2


@compiled
def invert_blocks(blocks, out):
    """The inverses (n, 9) of blocks of 3 x 3, (n, 9), into ``out``; whether there are all of them."""
    regular = True
    for i in range(len(blocks)):
        a, b = blocks[i], out[i]
        b[0], b[3], b[6] = a[4] * a[8] - a[5] * a[7], a[5] * a[6] - a[3] * a[8], a[3] * a[7] - a[4] * a[6]
        determinant = a[0] * b[0] + a[1] * b[3] + a[2] * b[6]
        if not abs(determinant) > 0:
            regular = False
            continue
        b[1], b[4], b[7] = a[2] * a[7] - a[1] * a[8], a[0] * a[8] - a[2] * a[6], a[1] * a[6] - a[0] * a[7]
        b[2], b[5], b[8] = a[1] * a[5] - a[2] * a[4], a[2] * a[3] - a[0] * a[5], a[0] * a[4] - a[1] * a[3]
        for k in range(9):
            b[k] /= determinant
    return regular
