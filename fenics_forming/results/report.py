"""`forming report`: one page on a run, with all that is needed to judge it, in one file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from . import page
from .files import whole_file
from .pictures.curves import kinds_of_columns, plot_history
from .pictures.drawing import close, frame_of, has_curve, new_axes
from .pictures.plotting import FIELDS as OF_A_RUN
from .pictures.plotting import plot_fields, plot_force_stroke
from .pictures.skin import Skin
from .pictures.tools import plot_load_displacement
from .readable import duration, thousands
from .table import name_and_unit

FIELDS = (*OF_A_RUN, "damage", "contact_pressure")
OF_A_STEP = ("step", "time_s", "load_factor", "dt_s", "newton_iterations", "power_imbalance")
TOO = ("stroke_", "force_", "torque_", "volume_error_", "max_")
SMALL = (5.2, 3.4)  # inches of a diagram
ROWS = 14            # of the history that are printed


def write_report(results, path: Path | str | None = None) -> Path:
    """Write the page.

    Parameters
    ----------
    results : `Results` with a folder
    path : the file; None: ``report.html`` in the folder

    Returns
    -------
    the path
    """
    path = Path(path) if path is not None else results.folder / "report.html"
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as partial:
        Path(partial).write_text(report(results), encoding="utf-8")
    return path


def report(results) -> str:
    """The page as HTML."""
    parts = [
        ("Key figures", page.tiles(key_figures(results))),
        ("Warnings", page.bullets([*results.summary.get("warnings", ()), *_cautions(results)], "warning")),
        ("Curves", page.figures(_curves(results))),
        ("Pictures", page.figures(_pictures(results))),
        ("Ledgers", _ledgers(results.summary.get("ledger", {}))),
        ("New meshes", _new_meshes(results.summary.get("remeshed", []))),
        ("Steps", _steps(results.history)),
        ("Where the time went", page.bars(results.summary.get("wall_s_by_part", {}), "s")),
        ("Scene", _scene(results)),
        ("Made with", _made_with(results.summary)),
    ]
    return page.page(results.title, parts, _head(results))


def _head(results) -> str:
    why = results.summary.get("stopped", "not ended")
    kind = " bad" if why.startswith("failed") else " open" if why in ("not ended", "interrupted") else ""
    facts = [getattr(results.scene, "geometry", "").replace("_", " ").replace("3d", "in space")]
    facts += [f"{results.summary[key]} {key}" for key in ("cells", "dofs") if key in results.summary]
    return (f"<h1>{page.escape(results.title)}</h1><p>{page.escape(' · '.join(filter(None, facts)))} "
            f'<span class="badge{kind}">{page.escape(why)}</span></p>')


def key_figures(results) -> list[tuple[str, str]]:
    """(what, value) of what one asks of a run first."""
    history, summary, facts = results.history, results.summary, []
    for tool in results.tools if len(history) else ():
        if f"stroke_{tool}_mm" in history.columns:
            facts.append((f"stroke of {tool}", f"{page.number(results.stroke(tool)[-1])} mm"))
        if results.force_column(tool) in history.columns and np.isfinite(results.force(tool)).any():
            largest = results.force(tool)[np.nanargmax(np.abs(results.force(tool)))]
            scale, prefix = thousands(largest)
            facts.append((f"largest force of {tool}", f"{page.number(largest / scale)} {prefix}{results.force_unit(tool)}"))
            facts += _work(results, tool)
    for column in history.columns:
        if column.startswith(("max_", "min_")):
            words, unit = name_and_unit(column)
            words = words.replace("max ", "largest ").replace("min ", "smallest ")
            facts.append((words + ", at the end", f"{page.number(history.rows[-1][column])} {unit}".strip()))
    for body, extents in summary.get("extents_mm", {}).items():
        largest = max(high - low for low, high in extents.values())
        ends = {axis: [_place(value, largest) for value in between] for axis, between in extents.items()}
        sizes = ", ".join(f"{axis} {low} … {high}" for axis, (low, high) in ends.items())
        facts.append((f"extents of {body} at the end, mm", sizes))
    errors = {c[len("volume_error_"):]: history.rows[-1][c] for c in history.columns if c.startswith("volume_error_")}
    facts += [(f"volume error of {body}", page.number(error)) for body, error in errors.items()]
    if "power_imbalance" in history.columns:
        worst = np.nanmax(np.abs(history.column("power_imbalance")))
        facts.append(("largest power imbalance", page.number(worst)))
    if "newton_iterations_per_solve" in summary:
        facts.append(("Newton iterations per solve", f"{summary['newton_iterations_per_solve']:.2f}"))
    if summary.get("remeshings"):
        facts.append(("new meshes", str(summary["remeshings"])))
    facts.append(("steps", str(int(history.rows[-1].get("step", len(history)))) if len(history) else "none"))
    if "wall_s" in summary:
        facts.append(("wall time", duration(summary["wall_s"])))
    return facts


def _place(value: float, size: float) -> str:
    """A place without the round-off that stands where it is zero."""
    return page.number(value if abs(value) > 1e-9 * size else 0.0)


def _work(results, tool) -> list[tuple[str, str]]:
    """Force times stroke, summed by trapezoids over the steps."""
    if f"stroke_{tool}_mm" not in results.history.columns or len(results.history) < 2:
        return []
    work = np.trapezoid(np.nan_to_num(results.force(tool)), results.stroke(tool)) / 1000
    scale, prefix = thousands(work)
    unit = "J/mm" if results.force_unit(tool) == "N/mm" else "J"
    return [(f"work of {tool}", f"{page.number(work / scale)} {prefix}{unit}")]


def _cautions(results) -> list[str]:
    """What the data of the materials do not cover."""
    from ..laws.library import library

    cautions = []
    if results.scene is None:
        return cautions
    used = {body.material for body in results.scene.workpieces.values()}
    for name in used & set(results.scene.materials):
        material = results.scene.materials[name]
        if getattr(material, "from_", None) is None or material.wrote("flow_stress"):
            continue
        entry = library(material.from_)
        if entry.generic:
            cautions.append(f"'{entry.name}' is a generic material, not a measured one")
        elif entry.is_recalled:
            cautions.append(f"the flow stress of '{entry.name}' was written down by heart: look it up in its source")
        strains = [c for c in results.history.columns if c.startswith("max_effective_strain")]
        largest = max((results.history.rows[-1][c] for c in strains), default=0.0) if len(results.history) else 0.0
        if entry.valid.strain is not None and largest > entry.valid.strain[1]:
            cautions.append(f"the effective strain reaches {largest:.3g}; the data of '{entry.name}' go to "
                            f"{entry.valid.strain[1]:g} and are extrapolated beyond")
    return cautions


def _curves(results) -> list[str]:
    if len(results.history) < 2:
        return []
    made = []
    if has_curve(results):
        ax = plot_force_stroke(results, ax=new_axes(SMALL))
        ax.set_title("")
        made.append(page.figure(page.picture_of(ax), "force over stroke"))
        close(ax)
    if "load_factor" in results.history.columns and len(results.history) > 2:
        ax = plot_load_displacement(results, ax=new_axes(SMALL))
        ax.set_title("")
        made.append(page.figure(page.picture_of(ax), "load over displacement"))
        close(ax)
    main = [results.force_column(results.main_tool())] if has_curve(results) else []
    for (kind, _), columns in kinds_of_columns(results).items():
        if columns == main or kind == "place" or all(np.ptp(results.history.column(c)) == 0 for c in columns):
            continue
        ax = plot_history(results, columns, title=kind, ax=new_axes(SMALL))
        made.append(page.figure(page.picture_of(ax), kind))
        close(ax)
    return made


def _pictures(results) -> list[str]:
    if not results.frames:
        return []
    skin = Skin.read(frame_of(results, -1)[1])
    made = []
    for field in filter(skin.full_name, FIELDS):
        if not np.nanmax(np.abs(np.diff(skin.field(field)[1])), initial=0.0):
            continue                       # the same everywhere, such as the temperature of a cold process
        if field == "contact_pressure" and skin.points.shape[1] == 2:
            from .surface import plot_contact_pressure

            ax = plot_contact_pressure(results, ax=new_axes(SMALL))
            ax.set_title("")
            made.append(page.figure(page.picture_of(ax), "contact pressure along the surface"))
            close(ax)
        else:
            made.append(_picture(plot_fields(results, field), name_and_unit(skin.full_name(field))[0]))
    return [*made, _picture(plot_fields(results, None), "mesh"), *_tools(results)]


def _tools(results) -> list[str]:
    """Stress and temperature of the tools that have frames of their own."""
    made = []
    for tool in getattr(results.scene, "tools", ()):
        if results.tool_frames(tool):
            skin = Skin.read(frame_of(results, -1, tool)[1])
            for field in filter(skin.full_name, ("von_mises", "temperature")):
                made.append(_picture(plot_fields(results, field, tool=tool), f"{field.replace('_', ' ')} of {tool}"))
    return made


def _picture(drawn, caption) -> str:
    if isinstance(drawn, np.ndarray):
        return page.figure(page.picture_of_array(drawn), caption)
    address = page.picture_of(drawn, "png")
    close(drawn)
    return page.figure(address, caption)


def _ledgers(ledger: dict) -> str:
    made = []
    for name, entries in ledger.items():
        rows = _flat(entries)
        if rows:
            made.append(f"<h3>{page.escape(name.replace('_', ' '))}</h3>{page.table(rows)}")
    return "".join(made)


def _flat(entries, above: str = "") -> list[list]:
    """Rows (words, value) of nested tables; what is None is left out."""
    rows = []
    for key, value in entries.items() if isinstance(entries, dict) else ():
        words, unit = name_and_unit(str(key)) if "_" in str(key) else (str(key), "")
        words = f"{above}{words}" + (f" ({unit})" if unit else "")
        if isinstance(value, dict):
            rows += _flat(value, f"{words}: ")
        elif value is not None:
            rows.append([words, value])
    return rows


def _new_meshes(records: list[dict]) -> str:
    if not records:
        return ""
    names = [name for name, value in records[0].items() if isinstance(value, (int, float, str))]
    return page.table([[record.get(name, "") for name in names] for record in records],
                      [name.replace("_", " ") for name in names])


def _steps(history) -> str:
    if not len(history):
        return ""
    wanted = [c for c in history.columns if c in OF_A_STEP or c.startswith(TOO)]
    chosen = np.unique(np.linspace(0, len(history) - 1, min(ROWS, len(history))).round().astype(int))
    head = [f"{words} ({unit})" if unit else words for words, unit in map(name_and_unit, wanted)]
    return page.table([[history.rows[k][c] for c in wanted] for k in chosen], head)


def _scene(results) -> str:
    file = None if results.folder is None else results.folder / "scene.toml"
    if file is None or not file.exists():
        return ""
    return f"<pre>{page.escape(file.read_text(encoding='utf-8').strip())}</pre>"


def _made_with(summary: dict) -> str:
    rows = [[name, str(version)] for name, version in summary.get("versions", {}).items()]
    if "ranks" in summary:
        rows.append(["processes", str(summary["ranks"])])
    if "peak_memory_MB" in summary:
        rows.append(["peak memory, MB", ", ".join(f"{value:g}" for value in summary["peak_memory_MB"])])
    built = summary.get("parts_built", [])
    return page.table(rows) + (f"<h3>What was built</h3>{page.bullets(built)}" if built else "")
