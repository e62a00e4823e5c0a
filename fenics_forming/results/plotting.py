"""Pictures of a run: force over stroke, fields on the whole section or body, the mesh."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from .files import ResultsError
from .progress import name_and_unit
from .results import thousands
from .skin import Skin

AXES = {"plane_strain": "xy", "axisymmetric": "rz", "3d": "xyz"}
COLOURS = "viridis"


def plot_force_stroke(results, *, tool: str | None = None, path: Path | str | None = None, ax=None, labels=None):
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
    for run, label in zip(runs, labels or _names(runs)):
        stroke, force = run.stroke(tool), run.force(tool) / scale
        ax.plot(stroke, force, marker="o" if len(stroke) < 40 else None, markersize=3, linewidth=1.6, label=label)
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


def plot_fields(results, field: str | None = "effective_strain", frame: int = -1, *, path: Path | str | None = None,
                mirror: bool = True, mesh: bool = True, tools=(), limits=None, ax=None):
    """A field on the body as it lies in one frame.

    Parameters
    ----------
    results : `Results` of a run with frames
    field : name of a field, with or without its unit; of a vector the magnitude is drawn; None: the mesh alone
    frame : number of the frame; negative ones count from the end
    path : picture to write
    mirror : show the whole body: both sides of an axis of revolution and of planes of symmetry
    mesh : draw the sides of the elements
    tools : outlines of tools, (k, 2) arrays of points (in the plane only)
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
    values, label = (None, "") if field is None else (skin.field(field)[1], _label(name))
    title = f"{_wrapped(results.title)}\n{_when(results, time)}"
    if skin.points.shape[1] == 3:
        from .plotting3d import draw

        levels = None if values is None else _levels(limits, 10)
        return draw(skin, values, label, levels, title, mesh=mesh, path=path)
    if ax is None:
        ax = _pyplot().subplots(figsize=_figure_size(skin.points), layout="constrained")[1]
    _draw_plane(ax, skin, values, label, limits, mesh=mesh)
    _draw_tools(ax, tools, mirrors, skin.points)
    ax.set(xlabel=f"{axes[0]} (mm)", ylabel=f"{axes[1]} (mm)")
    ax.set_title(title, fontsize="medium")
    return _saved(ax, path)


def plot_run(results, folder: Path | str, *, tools=()) -> list[Path]:
    """The pictures of a run in ``folder``: ``force_stroke.png`` and, of the last frame, ``effective_strain.png``,
    ``mean_stress.png``, ``mesh.png``; those for which the run has the numbers.

    Returns
    -------
    paths of the pictures
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    if results.tools and len(results.history) > 1 and results._force_column(results.main_tool()) in results.history.columns:
        _close(plot_force_stroke(results, path=folder / "force_stroke.png"))
        made.append(folder / "force_stroke.png")
    if results.frames:
        there = Skin.read(_frame(results, -1)[1]).fields
        for name, field in (("effective_strain",) * 2, ("mean_stress",) * 2, ("temperature",) * 2, ("mesh", None)):
            if field is None or any(key == field or key.startswith(field + "_") for key in there):
                _close(plot_fields(results, field, path=folder / f"{name}.png", tools=tools))
                made.append(folder / f"{name}.png")
    return made


# ---------------------------------------------------------------------- the plane
def _draw_plane(ax, skin, values, label, limits, *, mesh):
    from matplotlib.collections import LineCollection
    from matplotlib.tri import Triangulation

    x, y = skin.points.T
    triangulation = Triangulation(x, y, skin.triangles)
    if values is None:
        ax.tripcolor(triangulation, np.zeros(len(x)), cmap="Greys", vmin=-1, vmax=8, shading="gouraud")
    else:
        good = np.isfinite(values)
        triangulation.set_mask(~good[skin.triangles].all(axis=1))
        _coloured(ax, triangulation, np.where(good, values, 0.0), label, limits)
    inside, rim = skin.sides()
    if mesh or values is None:
        width = 0.5 if values is None else 0.25
        ax.add_collection(LineCollection(_curves(skin.points, inside), colors="0.15", linewidths=width, alpha=0.7))
    ax.add_collection(LineCollection(_curves(skin.points, rim), colors="black", linewidths=1.0, capstyle="round"))
    ax.set_aspect("equal")
    ax.use_sticky_edges = False
    ax.margins(0.04)
    ax.autoscale_view()


def _coloured(ax, triangulation, values, label, limits):
    from mpl_toolkits.axes_grid1 import make_axes_locatable

    levels = _levels(limits, 16)
    inside = values[triangulation.get_masked_triangles()]
    over, under = inside.max(initial=levels[0]) > levels[-1], inside.min(initial=levels[-1]) < levels[0]
    extend = {(0, 0): "neither", (1, 0): "max", (0, 1): "min", (1, 1): "both"}[int(over), int(under)]
    drawn = ax.tricontourf(triangulation, values, levels=levels, cmap=COLOURS, extend=extend)
    drawn.set_edgecolor("face")  # no white hairlines between the bands
    spread = np.ptp(triangulation.x), np.ptp(triangulation.y)
    flat = spread[1] < 0.45 * spread[0]
    bar = make_axes_locatable(ax).append_axes("bottom" if flat else "right", 0.15, pad=0.6 if flat else 0.15)
    colourbar = ax.figure.colorbar(drawn, cax=bar, orientation="horizontal" if flat else "vertical",
                                   ticks=levels[::2])
    peak = [f"highest {_figures(inside.max())}"] * over + [f"lowest {_figures(inside.min())}"] * under
    colourbar.set_label(", ".join([label] + peak))


def _curves(points, sides):
    """The sides of order 2 as short polylines through five points, (k, 5, 2)."""
    s = np.linspace(-1, 1, 5)[:, None]
    shapes = np.hstack([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2])
    return np.einsum("sk,nkd->nsd", shapes, points[sides])


def _draw_tools(ax, tools, mirrors, points):
    if not len(tools):
        return
    view = ax.get_xlim(), ax.get_ylim()
    outlines = [np.asarray(outline, float) for outline in tools]
    for axis, at in mirrors:
        flip = np.eye(2)[axis] * 2
        outlines += [outline * (1 - flip) + flip * at for outline in outlines]
    for outline in outlines:
        ax.plot(*outline.T, color="0.35", linewidth=2.0, solid_capstyle="butt", zorder=3)
    grown = [0.04 * np.ptp(points[:, k]) for k in (0, 1)]
    ax.set_xlim(view[0][0] - grown[0], view[0][1] + grown[0])
    ax.set_ylim(view[1][0] - grown[1], view[1][1] + grown[1])


def _figure_size(points):
    spread = np.ptp(points, axis=0)
    shape = float(np.clip(spread[1] / max(spread[0], 1e-30), 0.2, 3.0))
    width = 7.0 if shape < 0.9 else max(3.8, 6.3 / shape)
    height = width * shape if shape < 0.45 else (width - 1.3) * shape
    return width, float(np.clip(height + (2.0 if shape < 0.45 else 1.2), 3.0, 8.5))


# ---------------------------------------------------------------------- what to show
def _frame(results, number):
    by_time: dict[float, list[Path]] = {}
    for time, path in results.frames:
        by_time.setdefault(time, []).append(path)
    times = list(by_time)
    if not -len(times) <= number < len(times):
        raise ResultsError(f"there is no frame {number}: the run wrote {len(times)} frames"
                           + ("" if times else "; set [output] in the scene"))
    return times[number], by_time[times[number]]


def _mirrors(scene, axes, points):
    """(axis, position) of the planes to mirror at: the axis of revolution and planes of symmetry of all bodies."""
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


def _levels(limits, most):
    """Round numbers from below the lower limit to above the upper one."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(*limits)


def _label(name):
    words, unit = name_and_unit(name)
    return f"{words} ({unit})" if unit else words


def _figures(value):
    """Three figures, no exponent where none is needed, a true minus."""
    return f"{float(f'{value:.3g}'):.6g}".replace("-", "\N{MINUS SIGN}")


def _when(results, time):
    where = f"t = {time:.4g} s"
    if "time_s" in results.history.columns and results.tools:
        times = results.history.column("time_s")
        if f"stroke_{results.main_tool()}_mm" in results.history.columns and times[0] <= time <= times[-1] * (1 + 1e-9):
            where += f", stroke {np.interp(time, times, results.stroke()):.4g} mm"
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

    no_display = not os.environ.get("DISPLAY") and not os.environ.get("WAYLAND_DISPLAY") and sys.platform == "linux"
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
