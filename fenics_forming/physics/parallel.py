"""Sums and extremes over all ranks, for numbers and arrays; nothing is sent where there is one rank."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..errors import MeshError


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


def everywhere(comm: MPI.Comm, rows: np.ndarray) -> np.ndarray:
    """The rows of all ranks, one after the other, on every rank. Collective."""
    return np.concatenate(comm.allgather(rows)) if comm.size > 1 else rows


def on_first_rank(comm: MPI.Comm, action):
    """What ``action()`` returns on rank 0, None elsewhere; a `MeshError` there is raised on every rank. Collective."""
    answer = problem = None
    if comm.rank == 0:
        try:
            answer = action()
        except MeshError as error:
            problem = error
    told = comm.bcast(None if problem is None else str(problem), 0) if comm.size > 1 else problem
    if told is not None:
        raise problem or MeshError(told)
    return answer
