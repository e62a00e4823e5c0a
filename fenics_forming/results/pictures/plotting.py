"""Pictures of a run: force over stroke, fields on the whole section or body, the mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..flow_lines import lines_at
from ..readable import thousands
from .drawing import (
    AXES,
    close,
    frame_of,
    has_curve,
    label_of,
    limits_of,
    mirrors_of,
    names_of,
    new_axes,
    saved,
    when,
    wrapped,
)
from .in_plane import draw, figure_size, levels_of
from .outlines import as_segments, flipped, tool_outlines
from .skin import Skin
from .tools import plastic_limits, plot_load_displacement, visible

FIELDS = ("effective_strain", "mean_stress", "temperature", "von_mises", "displacement")
"""Of which `plot_run` draws the last frame, where the run has them."""


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
        ax = new_axes()
    largest = max((np.nanmax(np.abs(run.force(tool)), initial=0.0) for run in runs), default=0.0)
    scale, prefix = thousands(largest)
    for run, label in zip(runs, labels or names_of(runs), strict=True):
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
        ax.update_datalim([(ax.dataLim.x0, 0.0)])       # so that the room above a nearly even curve is a share of the force
        ax.autoscale_view()
        ax.set_ylim(bottom=0.0)
    if len(runs) == 1:
        ax.set_title(wrapped(runs[0].title), fontsize="medium")
    else:
        ax.legend(frameon=False, fontsize="small")
    return saved(ax, path)


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
    magnify: float | None = None,
    view=None,
    tool: str | None = None,
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
    tools : outlines of tools, arrays of points (k, 2), in space of triangles (k, 3, 3); None: those of the
        scene, where they are at that time
    limits : (low, high) of the colours; None: of the field, without a peak in a few spots
    magnify : how many times as large displacements of tools are drawn; None: so that they can be seen
    view : corners (low, high) of what is shown, mm (in the plane only); None: the body
    tool : name of a tool that deforms in the run, to draw it instead of the workpiece
    ax : matplotlib axes to draw in (in the plane only); None: a new figure

    Returns
    -------
    the matplotlib axes, or in space the picture (height, width, 3)

    Raises
    ------
    ResultsError
        if there is no such frame or field.
    """
    time, paths = frame_of(results, frame, tool)
    skin = Skin.read(paths)
    if field is not None:
        name, values = skin.field(field)
        limits = limits or (plastic_limits(skin, name) or limits_of(skin, values))
    times = 0.0 if field is None else visible(results, skin) if magnify is None else magnify
    axes = AXES.get(getattr(results.scene, "geometry", None), "xyz")
    mirrors = mirrors_of(results.scene, axes, skin.points, tool) if mirror else []
    skin = skin.deformed(times)
    for axis, at in mirrors:
        skin = skin.mirrored(axis, at)
    lines = lines_at(results, time) if field is None and tool is None else []
    for axis, at in mirrors:
        lines += [flipped(line, axis, at) for line in lines]
    values, label = (None, "") if field is None else (skin.field(field)[1], label_of(name))
    title = f"{wrapped(results.title)}\n{when(results, time)}"
    title += f", displacements \N{MULTIPLICATION SIGN} {times:g}" if times else ""
    space = skin.points.shape[1] == 3
    if tool is not None:
        outlines = []
    elif tools is None:
        outlines = tool_outlines(results, time, skin.points if view is None else np.asarray(view), mirrors)
    else:
        outlines = list(tools) if space else list(map(as_segments, tools))
    for axis, at in mirrors:
        outlines += [flipped(outline, axis, at) for outline in outlines]
    if space:
        from . import in_space as plotting3d

        levels = None if values is None else levels_of(limits, 10)
        return plotting3d.draw(skin, values, label, levels, title, mesh=mesh, lines=lines, tools=outlines, path=path)
    if ax is None:
        ax = new_axes(figure_size(skin.points if view is None else np.asarray(view)))
    draw(ax, skin, values, label, limits, mesh=mesh, tools=outlines, lines=lines, view=view)
    ax.set(xlabel=f"{axes[0]} (mm)", ylabel=f"{axes[1]} (mm)")
    ax.set_title(title, fontsize="medium")
    return saved(ax, path)


def plot_run(results, folder: Path | str, *, tools=None) -> list[Path]:
    """The pictures of a run in ``folder``, as far as the run has the numbers.

    ``force_stroke.png`` and, of the last frame, ``effective_strain.png``, ``mean_stress.png``,
    ``temperature.png``, ``contact_pressure.png`` (along the surface of a section), ``mesh.png`` and
    ``von_mises_TOOL.png`` of tools that deform; of tools alone
    ``load_displacement.png``, ``von_mises.png`` and ``displacement.png``.

    Returns
    -------
    paths of the pictures
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    if has_curve(results):
        close(plot_force_stroke(results, path=folder / "force_stroke.png"))
        made.append(folder / "force_stroke.png")
    if "load_factor" in results.history.columns and len(results.history) > 2:
        close(plot_load_displacement(results, path=folder / "load_displacement.png"))
        made.append(folder / "load_displacement.png")
    if results.frames:
        there = Skin.read(frame_of(results, -1)[1])
        for field in filter(there.full_name, FIELDS):
            close(plot_fields(results, field, path=folder / f"{field}.png", tools=tools))
            made.append(folder / f"{field}.png")
        if there.full_name("contact_pressure") and there.points.shape[1] == 2:
            from ..surface import plot_contact_pressure

            close(plot_contact_pressure(results, path=folder / "contact_pressure.png"))
            made.append(folder / "contact_pressure.png")
        close(plot_fields(results, None, path=folder / "mesh.png", tools=tools))
        made.append(folder / "mesh.png")
    for tool in getattr(results.scene, "tools", ()):
        if results.tool_frames(tool):
            close(plot_fields(results, "von_mises", path=folder / f"von_mises_{tool}.png", tool=tool))
            made.append(folder / f"von_mises_{tool}.png")
    return made
