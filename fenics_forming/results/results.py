"""What a run leaves behind, in memory or read from its folder."""

from __future__ import annotations

import json
import re
from functools import cached_property
from pathlib import Path

import numpy as np

from ..units import format_quantity
from .files import ResultsError, on_rank_zero, whole_file
from .flow_lines import FollowedLine, read_flow_line
from .history import History
from .readable import duration, thousands
from .recording.fields import read_frames


class Results:
    """History, summary, scene and frames of one run.

    Parameters
    ----------
    folder : folder of the run, or None for a run that wrote nothing
    scene : the scene; None: read from ``scene.toml`` when asked for
    history, summary : as in the folder; None: read when asked for
    """

    def __init__(
        self,
        folder: Path | str | None,
        scene=None,
        history: History | None = None,
        summary: dict | None = None,
    ):
        self.folder = None if folder is None else Path(folder)
        for name, value in dict(scene=scene, history=history, summary=summary).items():
            if value is not None:
                self.__dict__[name] = value

    @classmethod
    def read(cls, folder: Path | str) -> Results:
        """The results in a folder.

        Raises
        ------
        ResultsError
            if there is no history in it, nor the summary of a run that failed in its first solve.
        """
        results = cls(folder)
        if not any((results.folder / name).exists() for name in ("history.csv", "summary.json")):
            raise ResultsError(
                f"'{folder}' holds no results: it has no history.csv; name the folder given to --out"
            )
        return results

    @cached_property
    def history(self) -> History:
        """The table of the steps."""
        path = self._file("history.csv")
        return History() if path is None else History.read(path)

    @cached_property
    def summary(self) -> dict:
        """Numbers of the whole run, as in ``summary.json``; empty if the run has not ended."""
        path = self._file("summary.json")
        try:
            return {} if path is None else json.loads(path.read_text(encoding="utf-8"))
        except json.JSONDecodeError as error:
            raise ResultsError(f"'{path}' is not JSON: {error}") from None

    @cached_property
    def scene(self):
        """The scene of the run, or None if the folder has none."""
        from ..scene import read_scene

        path = self._file("scene.toml")
        return None if path is None else read_scene(path)

    @property
    def frames(self) -> list[tuple[float, Path]]:
        """(time in s, path of the ``.vtu`` file) of every frame; several bodies have one entry each."""
        return [] if self.folder is None else read_frames(self.folder)

    def tool_frames(self, tool: str) -> list[tuple[float, Path]]:
        """(time in s, path of the ``.vtu`` file) of every frame of a tool that deforms in the run."""
        return [] if self.folder is None else read_frames(self.folder, f"tool_{tool}")

    def flow_line(self, name: str) -> FollowedLine:
        """The line of material points ``[flow_lines.NAME]`` in every frame: places (frames, points, dim) and more.

        Raises
        ------
        ResultsError
            if the scene names no such line or the run wrote no frames.
        """
        return read_flow_line(self, name)

    @property
    def title(self) -> str:
        """Title of the scene, or name of the folder."""
        title = getattr(self.scene, "title", "") if self.scene is not None else ""
        return title or (self.folder.name if self.folder is not None else "run")

    # ------------------------------------------------------------------ per tool
    @property
    def tools(self) -> tuple[str, ...]:
        """Names of the tools in the history."""
        names = (
            re.fullmatch(r"(?:stroke_(.+)_mm)|(?:force_(.+?)_N(?:_per_mm)?)", c) for c in self.history.columns
        )
        return tuple(dict.fromkeys(m[1] or m[2] for m in names if m))

    def main_tool(self, tool: str | None = None) -> str:
        """``tool``, or the tool that travels farthest.

        Raises
        ------
        ResultsError
            if the history has no such tool.
        """
        if tool is None and self.tools:
            return max(self.tools, key=self._travel)
        if tool not in self.tools:
            raise ResultsError(
                f"the history has no tool '{tool}'; its tools are {', '.join(self.tools) or 'none'}"
            )
        return tool

    def stroke(self, tool: str | None = None) -> np.ndarray:
        """Stroke of a tool at the end of every step, (steps,), mm."""
        return self.history.column(f"stroke_{self.main_tool(tool)}_mm")

    def force(self, tool: str | None = None) -> np.ndarray:
        """Force of a tool in every step, (steps,), in :meth:`force_unit`; positive when it pushes."""
        return self.history.column(self.force_column(self.main_tool(tool)))

    def force_unit(self, tool: str | None = None) -> str:
        """ "N", or "N/mm" in plane strain."""
        return "N/mm" if self.force_column(self.main_tool(tool)).endswith("_per_mm") else "N"

    def force_column(self, tool: str) -> str:
        """Name of the column with the force of a tool."""
        per_mm = f"force_{tool}_N_per_mm"
        return per_mm if per_mm in self.history.columns else f"force_{tool}_N"

    def at(self, *, stroke: float | None = None, time: float | None = None, tool: str | None = None) -> dict:
        """The row at a stroke (mm) of a tool or at a time (s), interpolated linearly between two steps.

        Where the stroke is reached twice, the first time counts.

        Raises
        ------
        ResultsError
            if the run never was there.
        """
        if (stroke is None) == (time is None):
            raise ResultsError("at() takes a stroke or a time: at(stroke=5.0) or at(time=0.1)")
        wanted = stroke if time is None else time
        values = self.stroke(tool) if time is None else self.history.column("time_s")
        unit = "mm" if time is None else "s"
        slack = 1e-9 * max(1.0, abs(wanted))
        hits = np.flatnonzero(np.abs(values - wanted) <= slack)
        between = np.flatnonzero((values[:-1] - wanted) * (values[1:] - wanted) < 0)
        if len(hits) and (not len(between) or hits[0] <= between[0]):
            return dict(self.history.rows[hits[0]])
        if not len(between):
            reach = f"from {values.min():.6g} to {values.max():.6g} {unit}" if len(values) else "over no step"
            raise ResultsError(f"the run was never at {wanted:g} {unit}; its history goes {reach}")
        low, high = (self.history.rows[between[0] + k] for k in (0, 1))
        part = (wanted - values[between[0]]) / (values[between[0] + 1] - values[between[0]])
        return {name: low[name] + part * (high[name] - low[name]) for name in self.history.columns}

    # ------------------------------------------------------------------ seen
    def plot(self, *, tool: str | None = None, path: Path | str | None = None):
        """Force over stroke; see :func:`fenics_forming.results.pictures.plotting.plot_force_stroke`."""
        from .pictures.plotting import plot_force_stroke

        return plot_force_stroke(self, tool=tool, path=path)

    def __repr__(self):
        lines = _facts(self)
        width = max((len(name) for name, _ in lines), default=0)
        where = f" in {self.folder}" if self.folder is not None else ""
        joints = ["├─ "] * (len(lines) - 1) + ["└─ "] * bool(lines)
        return "\n".join(
            [f"Results{where}"]
            + [f"{j}{name:<{width}}  {text}" for j, (name, text) in zip(joints, lines, strict=True)]
        )

    def _travel(self, tool):
        there = f"stroke_{tool}_mm" in self.history.columns and len(self.history)
        return np.ptp(self.stroke(tool)) if there else -1.0

    def _file(self, name):
        if self.folder is None or not (self.folder / name).exists():
            return None
        return self.folder / name


def write_summary(folder: Path | str, summary: dict, comm=None) -> None:
    """Write ``summary.json``, numpy numbers and arrays as plain ones. Collective."""
    path = Path(folder) / "summary.json"

    def write():
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as partial:
            partial.write_text(json.dumps(summary, indent=2, default=_plain) + "\n", encoding="utf-8")

    on_rank_zero(comm, write)


def _plain(value):
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else str(value)


def _facts(results):
    """(name, text) of everything worth a line in the tree."""
    history, summary, facts = results.history, results.summary, []
    if results.scene is not None:
        facts.append(("scene", f"{results.title} ({results.scene.geometry})"))
    if len(history):
        last = history.rows[-1]
        until = f", until {last['time_s']:.6g} s" if "time_s" in last else ""
        facts.append(("steps", f"{last.get('step', len(history))}{until}"))
        facts += [(tool, _tool_facts(results, tool)) for tool in results.tools]
        facts += [
            (name[len("volume_error_") :], f"volume error {value:.2e}")
            for name, value in last.items()
            if name.startswith("volume_error_")
        ]
        facts += [("Newton", f"{iterations:.1f} iterations per solve") for iterations in _newton(results)]
        wall = summary.get("wall_s", sum(row.get("wall_s", 0.0) for row in history.rows))
        facts.append(("wall time", duration(wall)))
    else:
        facts.append(("steps", "none yet"))
    if results.frames:
        facts.append(("frames", f"{len({time for time, _ in results.frames})} in fields.pvd"))
    if summary.get("stopped"):
        facts.append(("stopped", summary["stopped"]))
    return facts


def _tool_facts(results, tool):
    parts, columns, turns = [], results.history.columns, f"torque_{tool}_Nmm" in results.history.columns
    if f"stroke_{tool}_mm" in columns and not (turns and not results.stroke(tool).any()):     # a roll only turns
        parts.append(f"stroke {format_quantity(results.stroke(tool)[-1], 'mm')}")
    if results.force_column(tool) in columns and np.isfinite(results.force(tool)).any():
        largest = np.nanargmax(np.abs(results.force(tool)))
        at = f" at {format_quantity(results.stroke(tool)[largest], 'mm')}" if parts else ""
        at = f" at {results.history.column('time_s')[largest]:.4g} s" if turns and not parts else at
        parts.append(f"largest force {_in_thousands(results.force(tool)[largest], results.force_unit(tool))}{at}")
    if turns:
        torque = results.history.column(f"torque_{tool}_Nmm")
        if np.isfinite(torque).any():
            unit = results.force_unit(tool).replace("N", "N m", 1)
            parts.append(f"largest torque {_in_thousands(torque[np.nanargmax(np.abs(torque))] / 1e3, unit)}")
    return ", ".join(parts)


def _in_thousands(value, unit):
    scale, prefix = thousands(value)
    return f"{value / scale:.4g} {prefix}{unit}"


def _newton(results):
    if results.summary.get("solves") == 0:
        return []
    if "newton_iterations_per_solve" in results.summary:
        return [results.summary["newton_iterations_per_solve"]]
    if "newton_iterations" in results.history.columns:
        return [float(np.mean(results.history.column("newton_iterations")))]
    return []
