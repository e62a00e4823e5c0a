"""Flexible GMRES for vectors that are spread over ranks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class KrylovResult:
    """Solution, number of iterations, by how much the residual has shrunk, and the norm of the right-hand side."""

    x: np.ndarray
    iterations: int
    reduction: float
    size: float


def fgmres(comm, times, precondition, b: np.ndarray, *, tolerance: float, most: int,
           settled: float = np.inf, start: np.ndarray | None = None, nothing: float = 0.0) -> KrylovResult:
    """Solve ``times(x) = b`` from ``start`` or from zero; the preconditioner may differ from call to call.

    Parameters
    ----------
    times, precondition : functions of the owned parts of vectors · b : owned part, (n,)
    tolerance : relative residual at which it stops · most : iterations, not restarted · settled : it goes on while an
    iteration changes the solution by more than this, relatively: a soft mode may hide in a small residual · nothing : norm
    up to which b is rounding, and the solution zero

    References
    ----------
    Y. Saad, SIAM J. Sci. Comput. 14 (1993) 461. Gram-Schmidt is done twice, by all vectors at once.
    """
    def dots(*pairs):
        return comm.allreduce(np.array([v @ w for v, w in pairs]))

    size = float(np.sqrt(dots((b, b))[0]))
    if size <= nothing or not np.isfinite(size):
        return KrylovResult(np.zeros_like(b), 0, 0.0 if size <= nothing else np.inf, size)
    r, left, whole = b, size, 0.0
    if start is not None:
        r = b - times(start)
        left, whole = np.sqrt(dots((r, r), (start, start)))
    if left <= tolerance * size:
        return KrylovResult(start, 0, left / size, size)
    basis, found = [r / left], []
    upper = np.zeros((most + 1, most))
    lengths = np.zeros((most, most))        # products of what the preconditioner found
    turns, rhs, y = [], np.zeros(most + 1), np.zeros(0)
    rhs[0] = left
    for k in range(most):
        z = precondition(basis[k])
        w = times(z)
        found.append(z)
        column = dots(*((v, w) for v in basis), *((f, z) for f in found))
        column, lengths[: k + 1, k] = column[: k + 1], column[k + 1:]
        lengths[k, : k + 1] = lengths[: k + 1, k]
        _take_off(column, basis, w)
        again = dots(*((v, w) for v in basis))
        _take_off(again, basis, w)
        column += again
        length = float(np.sqrt(dots((w, w))[0]))
        column = np.append(column, length)
        for i, (c, s) in enumerate(turns):
            column[i], column[i + 1] = c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]
        radius = float(np.hypot(column[k], column[k + 1]))
        if not np.isfinite(radius) or radius == 0.0:
            return KrylovResult(np.zeros_like(b), k + 1, np.inf, size)
        c, s = column[k] / radius, column[k + 1] / radius
        turns.append((c, s))
        upper[:k, k], upper[k, k] = column[:k], radius
        rhs[k], rhs[k + 1] = c * rhs[k], -s * rhs[k]
        before, y = np.append(y, 0.0), np.linalg.solve(upper[: k + 1, : k + 1], rhs[: k + 1])
        change, long = (np.sqrt(max(a @ lengths[: k + 1, : k + 1] @ a, 0.0)) for a in (y - before, y))
        if length == 0.0 or abs(rhs[k + 1]) <= tolerance * size and change <= settled * max(long, whole):
            break
        basis.append(w / length)
    m = len(found)
    x = np.zeros_like(b) if start is None else start.copy()
    for weight, z in zip(y, found, strict=True):
        x += weight * z
    return KrylovResult(x, m, abs(float(rhs[m])) / size, size)


def _take_off(weights, vectors, w) -> None:
    for weight, v in zip(weights, vectors, strict=True):
        w -= weight * v
