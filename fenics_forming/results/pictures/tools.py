"""Pictures of deformed tools: how far displacements are magnified, and curves of load over displacement."""

from __future__ import annotations

import re

import numpy as np

from .drawing import new_axes, saved, wrapped

SHARE = 0.04      # of the size of a tool: displacements are magnified to that


def visible(results, skin) -> float:
    """How many times as large displacements are to be drawn: a round number, 0 where there are none or where there are
    several parts, which would be torn apart by what closes their overlap."""
    if "displacement_mm" not in skin.fields or getattr(results.scene, "contacts", ()):
        return 0.0
    largest = np.nanmax(np.linalg.norm(skin.fields["displacement_mm"], axis=1), initial=0.0)
    if largest < 1e-12:
        return 0.0
    times = SHARE * np.ptp(skin.points, axis=0).max() / largest
    power = 10.0 ** np.floor(np.log10(times))
    return max(1.0, power * max(step for step in (1, 2, 5) if step * power <= times))


def plastic_limits(skin, name: str) -> tuple[float, float] | None:
    """All of the range of the plastic strain of tools, whose small zones are what is looked for; None of other fields."""
    if name != "effective_strain" or "displacement_mm" not in skin.fields:
        return None
    most = float(np.nanmax(skin.fields[name], initial=0.0))
    return (0.0, most) if most > 0 else None


def plot_load_displacement(results, *, path=None, ax=None):
    """Load factor over the displacements of the tracked points, or over the largest ones of the tools.

    Returns
    -------
    the matplotlib axes
    """
    ax = new_axes() if ax is None else ax
    history = results.history
    at_points: dict[str, list] = {}
    for column in history.columns:
        if match := re.fullmatch(r"(.+)_displacement_([rxyz])_mm", column):
            at_points.setdefault(match[1], []).append(history.column(column))
    curves = {name: np.linalg.norm(values, axis=0) for name, values in at_points.items()} or {
        m[1]: history.column(c) for c in history.columns if (m := re.fullmatch(r"max_displacement_(.+)_mm", c))}
    for name, values in curves.items():
        label = name.replace("_", " ")
        ax.plot(values, history.column("load_factor"), marker="o", markersize=3, linewidth=1.6, label=label)
    ax.set(xlabel="displacement (mm)", ylabel="load factor")
    ax.grid(True, linewidth=0.5, alpha=0.4)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize="small")
    ax.set_title(wrapped(results.title), fontsize="medium")
    return saved(ax, path)
