"""What a run says while it runs. The library prints nothing: it tells an observer; here is one that talks."""

from __future__ import annotations

import shutil
import sys

from ..errors import as_lines
from .table import laid_out


class Silent:
    """An observer that says nothing."""

    def started(self, simulation_info: str) -> None:
        """The run is built and starts."""

    def step(self, row: dict, limited_by: str) -> None:
        """A step was accepted: its row of the history, and what limited its size."""

    def note(self, text: str) -> None:
        """Something worth a line happened, such as a cut step."""

    def finished(self, results) -> None:
        """The run ended."""

    def __enter__(self):
        return self

    def __exit__(self, *error):
        return None


class Progress(Silent):
    """Prints one table row per step on rank 0, with a bar and the time left where stderr is a terminal.

    The rows go to stdout, the bar to stderr.

    Parameters
    ----------
    comm : MPI communicator, or None
    total : where the run ends, in the unit of ``of``; nan or 0 if that is not known: no bar then
    columns : names of history columns to print; None chooses step, time, strokes, forces, strain and Newton
        iterations from the first row
    of : the column that runs up to ``total``; None: the first stroke among the columns, or else the time
    quiet : print nothing

    Attributes
    ----------
    rows : how many steps it heard of, the start among them
    """

    def __init__(
        self,
        comm=None,
        total: float = float("nan"),
        columns=None,
        *,
        of: str | None = None,
        quiet: bool = False,
    ):
        self.total, self.columns, self.of = float(total), columns and tuple(columns), of
        self._speaks = not quiet and (comm is None or comm.rank == 0)
        self.rows = 0
        self._bar = self._task = None
        self._widths: list[int] = []

    def __exit__(self, *error):
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def started(self, simulation_info: str) -> None:
        """Print what was built and open the bar."""
        if self._speaks and self._bar is None and self.total > 0 and sys.stderr.isatty():
            self._open_bar()
        if simulation_info:
            self._say(as_lines(str(simulation_info), sys.stdout))

    def step(self, row: dict, limited_by: str) -> None:
        """Print the row and move the bar."""
        self.rows += 1
        if not self._speaks:
            return
        if not self._widths:
            self._head(row)
        texts = [_shown(row.get(name)) for name in self.columns]
        self._say(
            "  ".join(text.rjust(width) for text, width in zip(texts, self._widths, strict=True))
            + "  "
            + limited_by
        )
        if self._bar is not None and self.of in row:
            self._bar.update(self._task, completed=min(abs(row[self.of]), self.total))

    def note(self, text: str) -> None:
        """Print a line of its own."""
        self._say(as_lines(f"  {text}", sys.stdout, indent=4))

    def finished(self, results) -> None:
        """Close the bar and print the tree of the results."""
        self.__exit__()
        if self._speaks:
            self._say(repr(results))

    def _head(self, row):
        columns = self.columns or _telling(row)
        self.of = self.of or next((c for c in columns if c.startswith("stroke_")), "time_s")
        room = shutil.get_terminal_size().columns if sys.stdout.isatty() else float("inf")
        self.columns, self._widths, lines = laid_out(columns, room)
        for line in lines:
            self._say(line)

    def _say(self, text):
        if not self._speaks:
            return
        if self._bar is not None and sys.stdout.isatty():
            self._bar.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, flush=True)

    def _open_bar(self):
        from rich import progress
        from rich.console import Console

        self._bar = progress.Progress(
            progress.BarColumn(),
            progress.TaskProgressColumn(),
            progress.TextColumn("time left"),
            progress.TimeRemainingColumn(),
            progress.TextColumn("elapsed"),
            progress.TimeElapsedColumn(),
            console=Console(stderr=True),
            redirect_stdout=False,
            redirect_stderr=True,
            transient=True,
        )
        self._task = self._bar.add_task("run", total=self.total)
        self._bar.start()


def _telling(row):
    """The columns of a history that a person watches."""
    wanted = ["step", "time_s", "load_factor"]
    for start in ("stroke_", "force_", "torque_", "max_displacement_", "max_von_mises_", "contact_pressure_"):
        wanted += [c for c in row if c.startswith(start)]
    if "load_factor" in row:
        wanted += [c for c in row if c.startswith("max_effective_strain_")]
    telling = ["max_strain", "max_effective_strain", "min_temperature_degC", "max_temperature_degC", "newton_iterations"]
    return tuple(c for c in wanted + telling if c in row)


def _shown(value):
    if value is None:
        return "-"
    if isinstance(value, int) or value == 0:
        return str(int(value))
    if not 1e-4 <= abs(value) < 1e7:
        return f"{value:.4g}"
    return f"{float(f'{value:.5g}'):.10g}"
