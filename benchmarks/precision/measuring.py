"""What the work-precision diagrams share: one run as one row, the efficient front, tables and pictures."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import matplotlib.pyplot as plt

import fenics_forming as ff

FOLDER = Path(__file__).parent
COLUMNS = ("case", "series", "setup", "is_default", "unknowns", "steps", "cpu_s", "error", "on_front")
SHORT, LONG = 0.5, 2.0      # CPU seconds; runs below the first are made twice, the faster counts; above the second never
FLOOR = 1e-3        # errors below this count as equal: few references are known better
FRONT = 1.5         # a default may take so many times the fastest run that is no less exact: noise, and what is not tried


@dataclass(frozen=True)
class Trial:
    """One run: ``make()`` gives (error relative to the reference, unknowns, steps). ``default``: as the package has it
    if the user says nothing but a size and a step. ``runs`` : made by one call, which share its time.
    ``family`` : defaults are judged among trials that do the same."""

    series: str
    setup: str
    make: Callable[[], tuple[float, int, int]]
    default: bool = False
    runs: int = 1
    family: str = ""


@dataclass(frozen=True)
class Case:
    """A diagram: its trials, coarse to fine within a series; what the error is of; what varies along most lines."""

    name: str
    title: str
    error_of: str
    along: str                      # "steps" or "unknowns"
    trials: Callable[[], list[Trial]]
    reading: str = ""               # what one learns from it


def rows_of(case: Case) -> list[dict]:
    """Every trial made; a run that cannot go on has no error."""
    rows, begun, trials = [], set(), case.trials()
    trials[0].make()        # compiles, or loads what is compiled
    for trial in trials:
        row = {"case": case.name, "family": trial.family, "series": trial.series, "setup": trial.setup,
               "is_default": trial.default}
        try:
            spent, found = _timed(trial, again=trial.series not in begun)
        except ff.FormingError:
            rows.append(row)
            continue
        begun.add(trial.series)
        rows.append(row | {"unknowns": found[1], "steps": found[2], "cpu_s": round(spent, 3),
                           "error": float(f"{abs(found[0]):.3g}")})
    for row in rows:
        row["on_front"] = "error" in row and row["cpu_s"] <= FRONT * fastest(rows, row)["cpu_s"]
    return rows


def _timed(trial: Trial, again: bool):
    """CPU seconds and outcome; short ones, and the first of a series, which may have to load something, are made twice."""
    times = []
    for _ in range(2):
        before = process_time()
        found = trial.make()
        times.append((process_time() - before) / trial.runs)
        if times[0] > (LONG if again else SHORT):
            break
    return (min(times), found)


def fastest(rows: list[dict], than: dict) -> dict:
    """The fastest run of the same family that is no less exact."""
    error = max(than["error"], FLOOR)
    return min((row for row in rows if row["family"] == than["family"] and row.get("error", float("inf")) <= error),
               key=lambda row: row["cpu_s"])


def write(rows: list[dict], name: str) -> None:
    """The rows as a table of comma-separated values."""
    with (FOLDER / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS, restval="failed", lineterminator="\n", extrasaction="ignore")
        table.writeheader()
        table.writerows(rows)


# ---------------------------------------------------------------------- picture and text
MARKS = "os^Dvp*hX<>"


def draw(case: Case, rows: list[dict]) -> None:
    """Error against CPU time and against steps or unknowns; the defaults have a ring, the front a grey line."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 4.4), layout="constrained", sharey=True)
    done = [row for row in rows if row.get("error", 0) > 0]
    for number, series in enumerate(dict.fromkeys(row["series"] for row in done)):
        line = [row for row in done if row["series"] == series]
        style = {"marker": MARKS[number % len(MARKS)], "color": f"C{number % 10}", "markersize": 5, "linewidth": 1.2}
        for ax, key in ((left, "cpu_s"), (right, case.along)):
            ax.loglog([row[key] for row in line], [100 * row["error"] for row in line], label=series, **style)
    default = [row for row in done if row["is_default"]]
    for ax, key in ((left, "cpu_s"), (right, case.along)):
        ax.loglog([row[key] for row in default], [100 * row["error"] for row in default], "o", markersize=12,
                  markerfacecolor="none", markeredgecolor="k", label="default" if default else None)
        ax.grid(True, which="both", linewidth=0.4, alpha=0.4)
        _plain(ax.xaxis, [row[key] for row in done])
    _plain(left.yaxis, [100 * row["error"] for row in done])
    left.set(xlabel="CPU time (s)", ylabel=f"error of {case.error_of} (%)")
    right.set(xlabel=case.along)
    figure.suptitle(case.title, fontsize="medium")
    right.legend(frameon=False, fontsize="small", loc="upper left", bbox_to_anchor=(1, 1))
    figure.savefig(FOLDER / f"{case.name}.png", dpi=80)
    plt.close(figure)


def _plain(axis, values) -> None:
    """Numbers such as 0.2 or 5000 on a logarithmic axis, more of them where it is short."""
    from matplotlib.ticker import LogLocator, NullFormatter

    decades = max(values) / min(values)
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if decades < 200 else (1,)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def verdict(rows: list[dict]) -> list[dict]:
    """For every default: what it costs against the fastest run that is no less exact."""
    found = []
    for row in (row for row in rows if row["is_default"] and "error" in row):
        best = fastest(rows, row)
        found.append(row | {"times_the_fastest": row["cpu_s"] / best["cpu_s"],
                            "fastest": f"{best['series']}, {best['setup']}"})
    return found
