"""Files of a run: written whole or not at all, by rank 0 alone, with the same error on every rank."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path

from ..errors import FormingError


class ResultsError(FormingError):
    """A result that is missing, cannot be read or written, or does not fit what it is asked for."""


def in_words(error: OSError) -> str:
    """The sentence for a file that the system could not read or write."""
    where = f"'{error.filename}'" if error.filename else "a file of the results"
    return f"{where} could not be read or written: {error.strerror or error}"


@contextmanager
def whole_file(path: Path):
    """A name beside ``path`` to write to; it becomes ``path`` when the block ends well, else it vanishes."""
    partial = path.with_name(f".{path.stem}.partial{path.suffix}")
    try:
        with named_in_errors(path):
            yield partial
            os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def named_in_errors(path: Path):
    """Errors of the system in the block name ``path``: those of a full disk name nothing, others the partial file."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


def each_written(*actions) -> None:
    """Do all ``actions``, also where one finds no room for its file; the first `ResultsError` is raised at the end."""
    problems = []
    for action in actions:
        try:
            action()
        except ResultsError as problem:
            problems.append(problem)
    if problems:
        raise problems[0]


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
        raise ResultsError(in_words(error)) from error
