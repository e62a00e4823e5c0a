"""The table of a run: one row per step, written at once as a line of a CSV file."""

from __future__ import annotations

from numbers import Real
from pathlib import Path

import numpy as np

from .files import ResultsError, named_in_errors, on_rank_zero, whole_file

COUNTS = ("step", "newton_iterations", "remeshings", "cut_backs")


class History:
    """Rows of numbers under fixed names; the names carry the units.

    Every rank keeps the rows; only rank 0 writes. The columns are those of the first row. A new history
    replaces the file at its first row; :meth:`read` continues the one that is there.

    Parameters
    ----------
    path : the CSV file, or None to keep the rows in memory only
    comm : MPI communicator, or None where there is only this process
    """

    def __init__(self, path: Path | str | None = None, comm=None):
        self.path = None if path is None else Path(path)
        self.comm = comm
        self.columns: tuple[str, ...] = ()
        self.rows: list[dict[str, float]] = []
        self._file_is_ours = False

    @classmethod
    def read(cls, path: Path | str, comm=None) -> History:
        """The history in a file, ready for more rows. A last line that was cut off is left out. Collective.

        Raises
        ------
        ResultsError
            if there is no such file or a line is not numbers.
        """
        history = cls(path, comm)
        history.columns, history.rows, cut_off = on_rank_zero(comm, lambda: _parse(history.path))
        history._file_is_ours = not cut_off
        return history

    @classmethod
    def of_run(cls, folder: Path | None, comm=None, *, resume_after: int | None = None) -> History:
        """That of a run: new, in its folder or in memory; of a resumed one up to the step it goes on after. Collective."""
        path = None if folder is None else folder / "history.csv"
        if path is None or resume_after is None:
            return cls(path, comm)
        history = cls.read(path, comm)
        history.truncate_after(resume_after)
        return history

    def append(self, row: dict[str, float]) -> None:
        """Add a row and write it. Collective.

        A column that the row does not have is nan; one that the table does not have is an error.
        """
        columns = self.columns or tuple(row)
        strange = [name for name in row if name not in columns]
        if strange:
            raise ValueError(f"the history has no column {strange}; its first row had {list(columns)}")
        self.columns = columns
        self.rows.append({name: _number(name, row.get(name)) for name in columns})
        if self.path is None:
            return
        write, self._file_is_ours = self._write_last if self._file_is_ours else self._write_all, False
        on_rank_zero(self.comm, write)
        self._file_is_ours = True

    def complete(self) -> None:
        """Write all rows anew where the last one found no room: a checkpoint must not be ahead of them. Collective."""
        if self.path is not None and not self._file_is_ours:
            on_rank_zero(self.comm, self._write_all)
            self._file_is_ours = True

    def truncate_after(self, step: int) -> None:
        """Forget the rows after ``step``, in the file too: a run resumes there. Collective."""
        self.rows = [row for row in self.rows if row["step"] <= step]
        if self.path is not None:
            on_rank_zero(self.comm, self._write_all)
            self._file_is_ours = True

    def column(self, name: str) -> np.ndarray:
        """All values of one column, (rows,).

        Raises
        ------
        ResultsError
            if there is no such column.
        """
        if name not in self.columns:
            raise ResultsError(
                f"the history has no column '{name}'; it has {', '.join(self.columns) or 'no rows yet'}"
            )
        return np.array([row[name] for row in self.rows])

    def __len__(self):
        return len(self.rows)

    def __repr__(self):
        shown = self.rows if len(self.rows) <= 8 else self.rows[:4] + [None] + self.rows[-4:]
        head = self.columns[:8]
        lines = [list(head)] + [
            ["…"] * len(head) if row is None else [f"{row[c]:.6g}" for c in head] for row in shown
        ]
        widths = [max(len(line[k]) for line in lines) for k in range(len(head))]
        table = [
            "  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in lines
        ]
        more = len(self.columns) - len(head)
        note = f", {more} more columns: {', '.join(self.columns[len(head) :])}" if more else ""
        return "\n".join([f"History of {len(self.rows)} steps{note}"] + table * bool(head))

    def _write_last(self):
        with named_in_errors(self.path), open(self.path, "a", encoding="utf-8") as file:
            file.write(_line(self.rows[-1]))

    def _write_all(self):
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(self.path) as partial:
            partial.write_text(
                ",".join(self.columns) + "\n" + "".join(map(_line, self.rows)), encoding="utf-8"
            )


def _number(name, value):
    if value is None:
        return float("nan")
    return int(value) if name in COUNTS and isinstance(value, Real) and value == value else float(value)


def _line(row):
    return ",".join(map(repr, row.values())) + "\n"


def _parse(path):
    text = path.read_text(encoding="utf-8")
    lines = text.split("\n")
    cut_off = lines.pop() != ""
    if not lines:
        return (), [], True
    columns = tuple(lines[0].split(",")) if lines[0] else ()
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        values = line.split(",")
        try:
            if len(values) != len(columns):
                raise ValueError
            rows.append(
                {name: _number(name, float(value)) for name, value in zip(columns, values, strict=True)}
            )
        except ValueError:
            raise ResultsError(
                f"line {number} of '{path}' is not {len(columns)} numbers: '{line[:60]}'"
            ) from None
    return columns, rows, cut_off
