"""Pictures of a run: force over stroke, fields on the whole section or body, the mesh."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from .files import ResultsError
from .flow_lines import lines_at
from .outlines import as_segments, flipped, tool_outlines
from .plotting2d import draw, figure_size, levels_of
from .progress import name_and_unit
from .results import thousands
from .skin import Skin

AXES = {"plane_strain": "xy", "axisymmetric": "rz", "3d": "xyz"}


def plot_force_stroke(
    results, *, tool: str | None = None, path: Path | str | None = None, ax=None, labels=None
):
    """Force of a tool over its stroke, of one run or several.

    Parameters
    ----------
    results : `Results` or a list of them
    tool : name of the tool; None: the one that travels farthest in each run
    path : picture to write
    ax : matplotlib axes to draw in; None: a new figure
    labels : names of the runs in the legend; None: their titles

    Returns
    -------
    the matplotlib axes

    Raises
    ------
    ResultsError
        if the history has no such tool.
    """
    runs = list(results) if isinstance(results, (list, tuple)) else [results]
    if ax is None:
        ax = _pyplot().subplots(figsize=(6.4, 4.2), layout="constrained")[1]
    largest = max((np.nanmax(np.abs(run.force(tool)), initial=0.0) for run in runs), default=0.0)
    scale, prefix = thousands(largest)
    for run, label in zip(runs, labels or _names(runs), strict=True):
        stroke, force = run.stroke(tool), run.force(tool) / scale
        ax.plot(
            stroke, force, marker="o" if len(stroke) < 40 else None, markersize=3, linewidth=1.6, label=label
        )
    name = tool or (runs[0].main_tool() if len({run.main_tool() for run in runs}) == 1 else "tool")
    words = name.replace("_", " ")
    ax.set_xlabel(f"stroke of {words} (mm)")
    ax.set_ylabel(f"force of {words} ({prefix}{runs[0].force_unit(tool)})")
    ax.grid(True, linewidth=0.5, alpha=0.4)
    ax.margins(x=0.02)
    ax.spines[["top", "right"]].set_visible(False)
    if all(np.nanmin(run.force(tool), initial=0.0) >= 0 for run in runs):
        ax.set_ylim(bottom=0.0)
    if len(runs) == 1:
        ax.set_title(_wrapped(runs[0].title), fontsize="medium")
    else:
        ax.legend(frameon=False, fontsize="small")
    return _saved(ax, path)


def plot_fields(
    results,
    field: str | None = "effective_strain",
    frame: int = -1,
    *,
    path: Path | str | None = None,
    mirror: bool = True,
    mesh: bool = True,
    tools=None,
    limits=None,
    ax=None,
):
    """A field on the body as it lies in one frame; on the mesh alone its flow lines.

    Parameters
    ----------
    results : `Results` of a run with frames
    field : name of a field, with or without its unit; of a vector the magnitude is drawn; None: the mesh
    frame : number of the frame; negative ones count from the end
    path : picture to write
    mirror : show the whole body: both sides of an axis of revolution and of planes of symmetry
    mesh : draw the sides of the elements
    tools : outlines of tools, (k, 2) arrays of points (in the plane only); None: those of the scene, where
        they are at that time
    limits : (low, high) of the colours; None: of the field, without a peak in a few spots
    ax : matplotlib axes to draw in (in the plane only); None: a new figure

    Returns
    -------
    the matplotlib axes, or in space the picture (height, width, 3)

    Raises
    ------
    ResultsError
        if there is no such frame or field.
    """
    time, paths = _frame(results, frame)
    skin = Skin.read(paths)
    if field is not None:
        name, values = skin.field(field)
        limits = limits or _limits(skin, values)
    axes = AXES.get(getattr(results.scene, "geometry", None), "xyz")
    mirrors = _mirrors(results.scene, axes, skin.points) if mirror else []
    for axis, at in mirrors:
        skin = skin.mirrored(axis, at)
    lines = lines_at(results, time) if field is None else []
    for axis, at in mirrors:
        lines += [flipped(line, axis, at) for line in lines]
    values, label = (None, "") if field is None else (skin.field(field)[1], _label(name))
    title = f"{_wrapped(results.title)}\n{_when(results, time)}"
    if skin.points.shape[1] == 3:
        from . import plotting3d

        levels = None if values is None else levels_of(limits, 10)
        return plotting3d.draw(skin, values, label, levels, title, mesh=mesh, lines=lines, path=path)
    if ax is None:
        ax = _pyplot().subplots(figsize=figure_size(skin.points), layout="constrained")[1]
    outlines = (
        tool_outlines(results, time, skin.points, mirrors) if tools is None else list(map(as_segments, tools))
    )
    for axis, at in mirrors:
        outlines += [flipped(outline, axis, at) for outline in outlines]
    draw(ax, skin, values, label, limits, mesh=mesh, tools=outlines, lines=lines)
    ax.set(xlabel=f"{axes[0]} (mm)", ylabel=f"{axes[1]} (mm)")
    ax.set_title(title, fontsize="medium")
    return _saved(ax, path)


def plot_run(results, folder: Path | str, *, tools=None) -> list[Path]:
    """The pictures of a run in ``folder``, as far as the run has the numbers.

    ``force_stroke.png`` and, of the last frame, ``effective_strain.png``, ``mean_stress.png``,
    ``temperature.png`` and ``mesh.png``.

    Returns
    -------
    paths of the pictures
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    if _has_curve(results):
        _close(plot_force_stroke(results, path=folder / "force_stroke.png"))
        made.append(folder / "force_stroke.png")
    if results.frames:
        there = Skin.read(_frame(results, -1)[1])
        for field in filter(there.full_name, ("effective_strain", "mean_stress", "temperature")):
            _close(plot_fields(results, field, path=folder / f"{field}.png", tools=tools))
            made.append(folder / f"{field}.png")
        _close(plot_fields(results, None, path=folder / "mesh.png", tools=tools))
        made.append(folder / "mesh.png")
    return made


# ---------------------------------------------------------------------- what to show
def _has_curve(results):
    if len(results.history) < 2 or not results.tools:
        return False
    tool = results.main_tool()
    return {f"stroke_{tool}_mm", results.force_column(tool)} <= set(results.history.columns)


def _frame(results, number):
    by_time: dict[float, list[Path]] = {}
    for time, path in results.frames:
        by_time.setdefault(time, []).append(path)
    times = list(by_time)
    if not -len(times) <= number < len(times):
        raise ResultsError(
            f"there is no frame {number}: the run wrote {len(times)} frames"
            + ("" if times else "; set [output] in the scene")
        )
    return times[number], by_time[times[number]]


def _mirrors(scene, axes, points):
    """(axis, position) of the planes to mirror at: axis of revolution, planes of symmetry of all bodies."""
    if scene is None:
        return []
    common = set(axes).intersection(*(set(body.symmetry) for body in scene.workpieces.values()))
    planes = [(0, 0.0)] if scene.geometry == "axisymmetric" else []
    return planes + [(k, points[:, k].min()) for k, letter in enumerate(axes) if letter in common]


def _limits(skin, values):
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


def _label(name):
    words, unit = name_and_unit(name)
    return f"{words} ({unit})" if unit else words


def _when(results, time):
    where, columns = f"t = {time:.4g} s", results.history.columns
    if "time_s" in columns and results.tools and f"stroke_{results.main_tool()}_mm" in columns:
        stroke = np.interp(time, results.history.column("time_s"), results.stroke())
        where += f", stroke {stroke:.4g} mm"
    return where


def _names(runs):
    titles = [run.title for run in runs]
    if len(set(titles)) == len(titles):
        return titles
    return [str(run.folder) if run.folder is not None else f"run {k + 1}" for k, run in enumerate(runs)]


def _wrapped(title):
    import textwrap

    return "\n".join(textwrap.wrap(title, 60))


# ---------------------------------------------------------------------- matplotlib
def _pyplot():
    import matplotlib

    no_display = (
        not os.environ.get("DISPLAY") and not os.environ.get("WAYLAND_DISPLAY") and sys.platform == "linux"
    )
    if no_display and "inline" not in matplotlib.get_backend():
        matplotlib.use("Agg")
    import matplotlib.pyplot

    return matplotlib.pyplot


def _saved(ax, path):
    if path is not None:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        ax.figure.savefig(path, dpi=150, bbox_inches="tight", pad_inches=0.12)
    return ax


def _close(ax):
    if hasattr(ax, "figure"):
        _pyplot().close(ax.figure)
