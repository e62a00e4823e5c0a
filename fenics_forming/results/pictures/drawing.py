"""What all pictures of a run share: which frame, where mirrored, which colours and words, and matplotlib itself."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from ..files import ResultsError, whole_file
from ..table import name_and_unit

AXES = {"plane_strain": "xy", "axisymmetric": "rz", "3d": "xyz"}


def has_curve(results):
    """Whether the history has a force over a stroke."""
    if len(results.history) < 2 or not results.tools:
        return False
    tool = results.main_tool()
    return {f"stroke_{tool}_mm", results.force_column(tool)} <= set(results.history.columns)


def frame_of(results, number, tool=None):
    """Time in s and files of a frame, of the workpieces or of a tool; negative numbers count from the end."""
    by_time: dict[float, list[Path]] = {}
    for time, path in results.frames if tool is None else results.tool_frames(tool):
        by_time.setdefault(time, []).append(path)
    times = list(by_time)
    if not -len(times) <= number < len(times):
        raise ResultsError(
            f"there is no frame {number}: the run wrote {len(times)} frames"
            + ("" if times else "; set [output] in the scene")
        )
    return times[number], by_time[times[number]]


def mirrors_of(scene, axes, points, tool=None):
    """(axis, position) of the planes to mirror at: axis of revolution, planes of symmetry of all bodies, or of a tool."""
    if scene is None:
        return []
    bodies = {tool: scene.tools[tool]} if tool is not None else scene.workpieces or scene.tools
    common = set(axes).intersection(*(set(body.symmetry) for body in bodies.values()))
    planes = [(0, 0.0)] if scene.geometry == "axisymmetric" else []
    return planes + [(k, points[:, k].min()) for k, letter in enumerate(axes) if letter in common]


def limits_of(skin, values):
    """Lowest and highest value; a peak in less than 1 % of the area, as at a sharp corner, is left out."""
    corners = skin.points[skin.triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    square = (first**2).sum(1) * (second**2).sum(1) - (first * second).sum(1) ** 2
    area, means = np.sqrt(np.maximum(square, 0.0)), values[skin.triangles].mean(axis=1)
    good = np.isfinite(means)
    if not good.any():
        return 0.0, 1.0
    order = np.argsort(means[good])
    share = np.cumsum(area[good][order]) / area[good].sum()
    low, high = np.interp([0.01, 0.99], share, means[good][order])
    least, most = np.nanmin(values), np.nanmax(values)
    slack = 0.6 * (high - low)
    low, high = (least if least > low - slack else low), (most if most < high + slack else high)
    if high - low > 1e-9 * max(abs(low), abs(high), 1e-3):
        return low, high
    return (low - 0.5 * abs(low), high + 0.5 * abs(high)) if abs(low) > 1e-12 else (0.0, 1.0)


def label_of(name):
    """Words and unit of a field: "mean stress (MPa)"."""
    words, unit = name_and_unit(name)
    words = words.replace("von mises", "von Mises stress")
    return f"{words} ({unit})" if unit else words


def when(results, time):
    """Time, and stroke where there is one, or the load of tools alone, in words."""
    if "load_factor" in results.history.columns:
        of = "time_s" if "time_s" in results.history.columns else "load_factor"
        reached = np.interp(time, results.history.column("step"), results.history.column(of))
        return f"step {time:.0f}, {'t =' if of == 'time_s' else 'load factor'} {reached:.4g}{' s' * (of == 'time_s')}"
    where, columns = f"t = {time:.4g} s", results.history.columns
    if "time_s" in columns and results.tools and f"stroke_{results.main_tool()}_mm" in columns:
        stroke = np.interp(time, results.history.column("time_s"), results.stroke())
        where += f", stroke {stroke:.4g} mm"
    return where


def names_of(runs):
    """Titles of the runs where they differ, else their folders."""
    titles = [run.title for run in runs]
    if len(set(titles)) == len(titles):
        return titles
    return [str(run.folder) if run.folder is not None else f"run {k + 1}" for k, run in enumerate(runs)]


def wrapped(title):
    """A title in lines that fit above a picture."""
    import textwrap

    return "\n".join(textwrap.wrap(title, 60))


def pyplot():
    """matplotlib.pyplot, without a window where there is no display."""
    import matplotlib

    no_display = (
        not os.environ.get("DISPLAY") and not os.environ.get("WAYLAND_DISPLAY") and sys.platform == "linux"
    )
    if no_display and "inline" not in matplotlib.get_backend():
        matplotlib.use("Agg")
    import matplotlib.pyplot

    return matplotlib.pyplot


def new_axes(size=(6.4, 4.2)):
    """Axes of a new figure for a diagram, inches."""
    return pyplot().subplots(figsize=size, layout="constrained")[1]


def saved(ax, path):
    """The axes, written to a picture where a path is given."""
    if path is not None:
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path.with_suffix(path.suffix or ".png")) as partial:
            ax.figure.savefig(partial, dpi=150, bbox_inches="tight", pad_inches=0.12)
    return ax


def close(ax):
    """Free the figure of axes; anything else is left alone."""
    if hasattr(ax, "figure"):
        pyplot().close(ax.figure)
