"""Flexible GMRES for vectors that are spread over ranks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class KrylovResult:
    """Solution, number of iterations, and by how much the residual has shrunk."""

    x: np.ndarray
    iterations: int
    reduction: float


def fgmres(comm, times, precondition, b: np.ndarray, *, tolerance: float, most: int,
           start: np.ndarray | None = None) -> KrylovResult:
    """Solve ``times(x) = b`` from ``start`` or from zero; the preconditioner may differ from call to call.

    Parameters
    ----------
    times, precondition : functions of the owned parts of vectors · b : owned part, (n,)
    tolerance : relative residual at which it stops · most : iterations, not restarted

    References
    ----------
    Y. Saad, SIAM J. Sci. Comput. 14 (1993) 461. Gram-Schmidt is done twice, by all vectors at once.
    """
    def dots(vectors, w):
        return comm.allreduce(np.array([v @ w for v in vectors]))

    size = float(np.sqrt(dots([b], b)[0]))
    if size == 0.0 or not np.isfinite(size):
        return KrylovResult(np.zeros_like(b), 0, 0.0 if size == 0.0 else np.inf)
    r = b if start is None else b - times(start)
    left = size if start is None else float(np.sqrt(dots([r], r)[0]))
    if left <= tolerance * size:
        return KrylovResult(start, 0, left / size)
    basis, found = [r / left], []
    upper = np.zeros((most + 1, most))
    turns, rhs = [], np.zeros(most + 1)
    rhs[0] = left
    for k in range(most):
        z = precondition(basis[k])
        w = times(z)
        found.append(z)
        column = np.zeros(k + 1)
        for _ in range(2):
            h = dots(basis, w)
            for hi, v in zip(h, basis, strict=True):
                w -= hi * v
            column += h
        length = float(np.sqrt(dots([w], w)[0]))
        column = np.append(column, length)
        for i, (c, s) in enumerate(turns):
            column[i], column[i + 1] = c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]
        radius = float(np.hypot(column[k], column[k + 1]))
        if not np.isfinite(radius) or radius == 0.0:
            return KrylovResult(np.zeros_like(b), k + 1, np.inf)
        c, s = column[k] / radius, column[k + 1] / radius
        turns.append((c, s))
        upper[:k, k], upper[k, k] = column[:k], radius
        rhs[k], rhs[k + 1] = c * rhs[k], -s * rhs[k]
        if abs(rhs[k + 1]) <= tolerance * size or length == 0.0:
            break
        basis.append(w / length)
    m = len(found)
    y = np.linalg.solve(upper[:m, :m], rhs[:m])
    x = np.zeros_like(b) if start is None else start.copy()
    for weight, z in zip(y, found, strict=True):
        x += weight * z
    return KrylovResult(x, m, abs(float(rhs[m])) / size)
