"""Sums and extremes over all ranks, for numbers and arrays; nothing is sent where there is one rank."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI


def total(comm: MPI.Comm, value):
    """Sum over the ranks, element by element."""
    return _reduced(comm, value, MPI.SUM)


def lowest(comm: MPI.Comm, value):
    """Minimum over the ranks, element by element."""
    return _reduced(comm, value, MPI.MIN)


def highest(comm: MPI.Comm, value):
    """Maximum over the ranks, element by element."""
    return _reduced(comm, value, MPI.MAX)


def _reduced(comm, value, operation):
    if comm.size == 1:
        return value
    local = np.array(value, dtype=float, ndmin=1)
    result = np.empty_like(local)
    comm.Allreduce(local, result, operation)
    return result if np.ndim(value) else float(result[0])
