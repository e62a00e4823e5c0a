"""Files of a run: written whole or not at all, by rank 0 alone, with the same error on every rank."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path

from ..errors import FormingError


class ResultsError(FormingError):
    """A result that is missing, cannot be read or written, or does not fit what it is asked for."""


@contextmanager
def whole_file(path: Path):
    """A name beside ``path`` to write to; it becomes ``path`` when the block ends well, else it vanishes."""
    partial = path.with_name(f".{path.stem}.partial{path.suffix}")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def on_rank_zero(comm, action):
    """``action()`` on rank 0, its answer on every rank; a failure there is a `ResultsError` on every rank.

    Collective. Without it a full disk on rank 0 would leave the other ranks waiting for ever.
    """
    if comm is None or comm.size == 1:
        return _answer(action)
    problem = answer = None
    if comm.rank == 0:
        try:
            answer = _answer(action)
        except Exception as error:  # whatever it is, the other ranks must hear of it
            problem = error
    told, answer = comm.bcast((problem and str(problem), answer), 0)
    if told is not None:
        raise problem or ResultsError(told)
    return answer


def _answer(action):
    try:
        return action()
    except OSError as error:
        where = f"'{error.filename}' " if error.filename else "a file of the results "
        raise ResultsError(f"{where}could not be read or written: {error.strerror or error}") from error
