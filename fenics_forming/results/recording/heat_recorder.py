"""Rows, frames and summary of a run of heat alone."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from ...physics.parallel import highest, lowest
from ..files import each_written, on_rank_zero
from ..history import History
from ..results import Results, write_summary
from .fields import FieldWriter
from .heat_frames import ToolHeatFrames
from .recorder import peak_memory, versions


class HeatRecorder:
    """Writes what a run of heat alone leaves behind.

    Parameters
    ----------
    run : `simulation.heat_alone.HeatSimulation`
    out : folder, or None: rows are kept in memory only
    resume_after : step after which a resumed run goes on
    """

    def __init__(self, run, out: Path | str | None, *, resume_after: int | None = None):
        self.run, self.scene, self.comm = run, run.scene, run.comm
        self.out = None if out is None else Path(out)
        self.row: dict[str, float] = {}
        self.summary: dict = {}
        self.seconds, self._last_frame, self.fields = 0.0, -1, None
        if self.out is not None:
            on_rank_zero(self.comm, lambda: self._clear() if resume_after is None else None)
            self.fields = FieldWriter(self.out, self.comm, resume_after=resume_after)
            self.tool_heat = ToolHeatFrames(self.out, run.tools, self.comm, resume_after=resume_after)
        self.history = History.of_run(self.out, self.comm, resume_after=resume_after)
        self._began, self._cpu = perf_counter(), process_time()

    def _clear(self) -> None:
        self.out.mkdir(parents=True, exist_ok=True)
        for name in ("history.csv", "summary.json", "checkpoint.npz"):
            (self.out / name).unlink(missing_ok=True)
        (self.out / "scene.toml").write_text(self.scene.to_toml(), encoding="utf-8")

    def introduction(self) -> str:
        """One line on what runs."""
        return (f"{self.scene.title or 'untitled scene'} · {self.scene.geometry} · heat alone · {self._cells()} cells, "
                f"{self._dofs()} temperatures · {self.comm.size} rank{'s' * (self.comm.size > 1)} · built in "
                f"{self.run.seconds_to_build:.1f} s")

    # ------------------------------------------------------------------ a step
    def step(self, dt: float, wall: float) -> None:
        """Record where the run is: a row, and a frame and a checkpoint where they are due. Collective."""
        run, output = self.run, self.scene.output
        start = perf_counter()
        run.ledger.book(run.state)
        self.row = self._row(dt, wall)
        self.history.append(self.row)
        if self.out is not None:
            if run.step == 0 or (output.fields_every and run.step % output.fields_every == 0):
                self._frame()
            if output.checkpoint_every and run.step and run.step % output.checkpoint_every == 0:
                run.save(self.out / "checkpoint.npz")
        self.seconds += perf_counter() - start

    def _row(self, dt: float, wall: float) -> dict[str, float]:
        run, temperature = self.run, self.run.history["temperature"]
        row = {"step": run.step, "time_s": run.time, "dt_s": dt,
               "max_temperature_degC": highest(self.comm, float(temperature.max(initial=-np.inf))),
               "min_temperature_degC": lowest(self.comm, float(temperature.min(initial=np.inf))),
               "mean_temperature_degC": run.heat.field.mean(temperature)}
        for name in run.parts.names if run.parts is not None else ():
            mine = temperature[self._mine(name)]
            row[f"max_temperature_{name}_degC"] = highest(self.comm, float(mine.max(initial=-np.inf)))
            row[f"min_temperature_{name}_degC"] = lowest(self.comm, float(mine.min(initial=np.inf)))
        row |= run.ledger.row(run.state, "J_per_mm" if self.scene.geometry == "plane_strain" else "J")
        row["wall_s"] = wall
        if run.points is not None:
            nodal = np.column_stack([run.nodes.x, temperature])
            columns = [*(f"{axis}_mm" for axis in self.scene.axes), "temperature_degC"]
            for label, (values,) in run.points.values(nodal).items():
                row |= {f"{label}_{column}": float(value) for column, value in zip(columns, values, strict=True)}
        return row

    def _frame(self) -> None:
        run = self.run
        if run.step != self._last_frame:
            self._last_frame = run.step
            self.fields.write(run.nodes, step=run.step, time=run.time,
                              point_data={"temperature_degC": run.history["temperature"]})
            self.tool_heat.write(step=run.step, time=run.time, state=run.state)

    # ------------------------------------------------------------------ the end
    def finish(self, why: str, warnings: list[str]) -> None:
        """Last frame, checkpoint and summary, also of a run that was interrupted. Collective."""
        each_written(self._leave, lambda: self._sum_up(why, warnings))

    def _leave(self) -> None:
        start = perf_counter()
        if self.out is not None and len(self.history):
            each_written(self._frame, self._checkpoint)
        self.seconds += perf_counter() - start

    def _checkpoint(self) -> None:
        if self.scene.output.checkpoint_every:
            self.history.complete()
            self.run.save(self.out / "checkpoint.npz")

    def _sum_up(self, why: str, warnings: list[str]) -> None:
        self.summary = self._summary(why) | {"warnings": [*warnings, *self.run.ledger.doubts()]}
        if self.out is not None:
            write_summary(self.out, self.summary, self.comm)

    def results(self) -> Results:
        return Results(self.out, scene=self.scene, history=self.history, summary=self.summary)

    def _summary(self, why: str) -> dict:
        run, wall = self.run, perf_counter() - self._began
        seconds = {"heat": run.heat.seconds, "output": self.seconds}
        seconds["other"] = max(0.0, wall - sum(seconds.values()))
        return {
            "title": self.scene.title, "stopped": why, "versions": versions(), "ranks": self.comm.size,
            "cells": self._cells(), "dofs": self._dofs(), "parts_built": run.heat.parts_built(),
            "extents_mm": self._extents(),
            "ledger": {"heat": run.ledger.summary()}, "steps": run.step, "solves": 0, "newton_iterations": 0,
            "newton_iterations_per_solve": 0.0, "remeshings": 0, "seconds_to_build": run.seconds_to_build, "wall_s": wall,
            "cpu_s": process_time() - self._cpu, "wall_s_by_part": seconds, "peak_memory_MB": peak_memory(self.comm),
        }

    def _extents(self) -> dict[str, dict[str, list[float]]]:
        """Body → axis → lowest and highest coordinate, mm. Collective."""
        found = {}
        for name in self.scene.workpieces:
            x = self.run.nodes.x if self.run.parts is None else self.run.nodes.x[self._mine(name)]
            low, high = lowest(self.comm, x.min(axis=0, initial=np.inf)), highest(self.comm, x.max(axis=0, initial=-np.inf))
            found[name] = {a: [float(lo), float(hi)] for a, lo, hi in zip(self.scene.axes, low, high, strict=True)}
        return found

    def _mine(self, name: str) -> np.ndarray:
        return self.run.parts.of_node == self.run.parts.names.index(name)

    def _cells(self) -> int:
        topology = self.run.nodes.mesh.topology
        return int(topology.index_map(topology.dim).size_global)

    def _dofs(self) -> int:
        return int(self.run.nodes.scalar_space.dofmap.index_map.size_global)
