"""Rows, frames and summary of a run of deformable tools alone."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from ...physics.parallel import highest
from ..files import each_written, on_rank_zero
from ..history import History
from ..results import Results, write_summary
from .bodies import resultant_columns
from .fields import FieldWriter
from .recorder import peak_memory, versions
from .tool_fields import contact_numbers, energies, imbalance, part_numbers, point_data, tracked

ENERGY_SLACK = 1e-3     # of the work of the loads: more of it missing is worth a word


class ToolRecorder:
    """Writes what a run of tools alone leaves behind.

    Parameters
    ----------
    run : `simulation.tools_alone.ToolSimulation`
    out : folder, or None: rows are kept in memory only
    resume_after : step after which a resumed run goes on
    """

    def __init__(self, run, out: Path | str | None, *, resume_after: int | None = None):
        self.run, self.scene, self.comm = run, run.scene, run.comm
        self.out = None if out is None else Path(out)
        self.row: dict[str, float] = {}
        self.seconds = {"output": 0.0}
        self.iterations, self.solves, self._last_frame, self._fields = 0, 0, -1, {}
        self.unit = "N_per_mm" if self.scene.geometry == "plane_strain" else "N"
        self.fields = None
        if self.out is not None:
            on_rank_zero(self.comm, self._clear if resume_after is None else lambda: None)
            self.fields = FieldWriter(self.out, self.comm, resume_after=resume_after)
        self.history = History.of_run(self.out, self.comm, resume_after=resume_after)
        self.summary: dict = {}
        self._began, self._cpu = perf_counter(), process_time()

    def _clear(self) -> None:
        self.out.mkdir(parents=True, exist_ok=True)
        for old in (self.out / "history.csv", self.out / "summary.json", *self.out.glob("checkpoint*.npz")):
            old.unlink(missing_ok=True)
        (self.out / "scene.toml").write_text(self.scene.to_toml(), encoding="utf-8")

    def introduction(self) -> str:
        """One line on what runs."""
        run = self.run
        return (f"{self.scene.title or 'untitled scene'} · {self.scene.geometry} · {run.cells} cells, {run.dofs} degrees "
                f"of freedom · {self.comm.size} rank{'s' * (self.comm.size > 1)} · built in {run.seconds_to_build:.1f} s")

    # ------------------------------------------------------------------ a step
    def step(self, step: int, reached: dict[str, float], wall: float) -> None:
        """Record where the tools are, with the load factor (and time) reached: a row, and a frame where one is due.
        Collective."""
        start = perf_counter()
        self._fields = {name: tool.field() for name, tool in self.run.tools.items()}
        self.row = {"step": step} | reached
        for name, tool in self.run.tools.items():
            self.row |= self._row(name, tool)
        self.row |= self._tracked()
        spent = sum(tool.iterations for tool in self.run.tools.values()) if step else 0
        cuts = sum(tool.solver.cuts for tool in self.run.tools.values())
        self.row |= {"newton_iterations": spent, "cut_backs": cuts, "wall_s": wall}
        self.history.append(self.row)
        self.iterations += spent
        self.solves += step > 0
        every = self.scene.output.fields_every
        if reached["load_factor"] == 0.0 or (every and step % every == 0):      # also where it is only put together
            self._frame()
        self.seconds["output"] += perf_counter() - start

    def _row(self, name: str, tool) -> dict[str, float]:
        field, row, comm = self._fields[name], {}, self.comm
        row[f"max_von_mises_{name}_MPa"] = highest(comm, float(field.von_mises.max(initial=0.0)))
        row[f"max_displacement_{name}_mm"] = highest(comm, float(np.linalg.norm(field.displacement, axis=1).max(initial=0)))
        if field.body.yields:
            row[f"max_effective_strain_{name}"] = highest(comm, float(field.plastic_strain.max(initial=0.0)))
        given = {contact.name: contact for contact in self.scene.contacts}
        along = {axis: self._copies(name, number) for number, axis in enumerate(self.scene.axes)}
        for label, contact in self.run.contacts(name).items():
            row |= resultant_columns(given[label], contact.holder, contact.force(), along, self.unit)
            numbers, label = contact_numbers(contact, comm), label.replace("-", "_")
            row[f"contact_force_{label}_{self.unit}"] = numbers["force"] * self._copies(name)
            row[f"contact_pressure_{label}_MPa"] = numbers["pressure"]
        for face, shifts in self.scene.tools[name].held.items():
            reaction = field.reaction(tool.tool.faces.named(face, f"tools.{name}.held.{face}"))
            for axis in shifts:
                number = self.scene.axes.index(axis)
                row[f"reaction_{name}_{face}_{axis}_{self.unit}"] = float(reaction[number]) * self._copies(name, number)
        return row

    def _copies(self, name: str, along: int | None = None) -> int:
        """Parts of the whole tool that the mesh stands for; with an axis, those on which the same force acts."""
        mirrored = {self.scene.axes.index(axis) for axis in self.scene.tools[name].symmetry}
        return 2 ** len(mirrored - {along})

    def _tracked(self) -> dict[str, float]:
        """Places, displacements and stresses of the tracked points."""
        row = {}
        for name, points in self.run.points.items():
            row |= tracked(self._fields[name], points, self.scene.axes)
        return row

    def _frame(self) -> None:
        step = self.row["step"]
        if self.out is None or step == self._last_frame:
            return
        self._last_frame = step
        several = len(self.run.tools) > 1
        for name, tool in self.run.tools.items():
            parts = tool.tool.parts
            cells = {"body": parts.of_cell.astype(np.int32)} if len(parts.names) > 1 else None
            self.fields.write(tool.tool.body.nodes, step=step, time=float(step), body=name if several else "",
                              point_data=point_data(self._fields[name], self.run.contacts(name).values()), cell_data=cells)

    # ------------------------------------------------------------------ the end
    def finish(self, why: str, warnings: list[str]) -> None:
        """Last frame and summary, also of a run that failed. Collective."""
        each_written(self._leave, lambda: self._sum_up(why, warnings))

    def _leave(self) -> None:
        start = perf_counter()
        if self._fields:
            self._frame()
        self.seconds["output"] += perf_counter() - start

    def _sum_up(self, why: str, warnings: list[str]) -> None:
        self.summary = self._summary(why) | {"warnings": warnings}
        if self.out is not None:
            write_summary(self.out, self.summary, self.comm)

    def doubts(self) -> list[str]:
        """Tools whose energies do not add up, one sentence each. Collective."""
        missing = {name: imbalance(energies(field)) for name, field in self._fields.items()}
        return [f"tools.{name}: {share:.1e} of the work of its loads is neither stored nor dissipated; try more steps.loads"
                for name, share in missing.items() if share > ENERGY_SLACK]

    def results(self) -> Results:
        return Results(self.out, scene=self.scene, history=self.history, summary=self.summary)

    def _summary(self, why: str) -> dict:
        run, wall = self.run, perf_counter() - self._began
        numbers = {name: {part: part_numbers(field, run.tools[name].tool.parts, part)
                          for part in run.tools[name].tool.parts.names} for name, field in self._fields.items()}
        extents = {part: found.pop("extents_mm") for parts in numbers.values() for part, found in parts.items()}
        seconds = dict(self.seconds)
        for tool in run.tools.values():
            for part, spent in tool.solver.seconds.items():
                seconds[part] = seconds.get(part, 0.0) + spent
        seconds["other"] = max(0.0, wall - sum(seconds.values()))
        return {
            "title": self.scene.title, "stopped": why, "versions": versions(), "ranks": self.comm.size,
            "cells": run.cells, "dofs": run.dofs, "parts_built": run.parts_built(),
            "extents_mm": {name: {a: [float(low), float(high)] for a, low, high in zip(self.scene.axes, *e, strict=True)}
                           for name, e in extents.items()},
            "tools": numbers, "factorisations": {name: _factorisations(tool.solver) for name, tool in run.tools.items()},
            "ledger": {"energy": {name: energies(field) for name, field in self._fields.items()}},
            "steps": int(self.row.get("step", 0)), "solves": self.solves, "newton_iterations": self.iterations,
            "newton_iterations_per_solve": self.iterations / max(self.solves, 1), "cut_backs": self.row.get("cut_backs", 0),
            "load_factor": self.row.get("load_factor", 0.0), "remeshings": 0,
            "seconds_to_build": run.seconds_to_build, "wall_s": wall, "cpu_s": process_time() - self._cpu,
            "wall_s_by_part": seconds, "peak_memory_MB": peak_memory(self.comm),
        }


def _factorisations(solver) -> int:
    """How often a stiffness was factorised: once for a tool that stays elastic, whatever its loads."""
    return getattr(solver, "factorisations", 0) + solver.factor.factorisations
