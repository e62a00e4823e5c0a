"""Diagrams of the history: everything of one kind in one diagram, over the stroke or the time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..table import name_and_unit
from .drawing import new_axes, saved

LEFT_OUT = ("step", "time_s", "load_factor", "dt_s", "wall_s", "newton_iterations", "cut_backs")
KINDS = {"N": "force", "N/mm": "force", "N mm": "torque", "MPa": "stress", "°C": "temperature", "mm": "place",
         "J": "heat", "mJ": "energy"}                                                   # by unit
WORDS = {"effective_strain": "effective strain", "volume_error": "volume error", "power_imbalance": "power imbalance",
         "damage": "damage", "stability": "stability number"}


def kinds_of_columns(results) -> dict[tuple[str, str], list[str]]:
    """Columns of the history by (words, unit) of what they hold; places of points and volumes are left out."""
    kinds: dict[tuple[str, str], list[str]] = {}
    for column in results.history.columns:
        words, unit = name_and_unit(column)
        if column in LEFT_OUT or column.startswith(("stroke_", "volume_")) and unit:
            continue
        named = next((text for key, text in WORDS.items() if key in column), words)
        kinds.setdefault((KINDS.get(unit, words) if unit else named, unit), []).append(column)
    return kinds


def plot_history(results, columns: list[str], *, title: str = "", path: Path | str | None = None, ax=None):
    """Columns of the history, all of one unit, over the stroke of the main tool, else over time or load.

    Parameters
    ----------
    results : `Results`
    columns : names of columns
    title : of the vertical axis; none: the words of the first column
    path : picture to write
    ax : matplotlib axes to draw in; None: a new figure

    Returns
    -------
    the matplotlib axes
    """
    ax = ax or new_axes()
    words, unit = name_and_unit(columns[0])
    across, along = _across(results)
    for column in columns:
        name = name_and_unit(column)[0]
        ax.plot(across, results.history.column(column), linewidth=1.5, label=name)
    ax.set_xlabel(along)
    title = title or words
    ax.set_ylabel(f"{title} ({unit})" if unit else title)
    ax.grid(True, linewidth=0.5, alpha=0.4)
    ax.margins(x=0.02)
    ax.spines[["top", "right"]].set_visible(False)
    ax.ticklabel_format(axis="y", scilimits=(-3, 5), useMathText=True)
    if len(columns) > 1:
        ax.legend(frameon=False, fontsize="small")
    return saved(ax, path)


def _across(results) -> tuple[np.ndarray, str]:
    history = results.history
    if results.tools:
        tool = results.main_tool()
        column = f"stroke_{tool}_mm"
        if column in history.columns and np.ptp(history.column(column)) > 0:
            return history.column(column), f"stroke of {tool.replace('_', ' ')} (mm)"
    column, along = next(pair for pair in (("time_s", "time (s)"), ("load_factor", "load factor"), ("step", "step"))
                         if pair[0] in history.columns)
    return history.column(column), along
