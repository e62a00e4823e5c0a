"""Turns the state of a run into rows of the history, frames and the summary."""

from __future__ import annotations

from dataclasses import asdict
from functools import cache
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from ..files import each_written, on_rank_zero
from ..flow_lines import NAME as FLOW_LINES
from ..flow_lines import FlowLineWriter
from ..history import History
from ..results import Results, write_summary
from ..untouched import untouched
from .bodies import BodyRecord, in_words
from .contact_forces import ContactForceWriter, remove_after
from .directions import pushing_direction
from .energy import MotionRecord
from .equipment import equipment_columns
from .fields import FieldWriter, start_frames

MORE_EXACT = "smaller steps or a larger solver.penalty_factor"

class Recorder:
    """Writes what a run leaves behind.

    Parameters
    ----------
    simulation : the run
    out : folder, or None: rows are kept in memory only
    resume_after : step after which a resumed run goes on
    """

    def __init__(self, simulation, out: Path | str | None, *, resume_after: int | None = None):
        self.run = simulation
        self.scene, self.comm = simulation.scene, simulation.comm
        self.out = None if out is None else Path(out)
        self.seconds = {"output": 0.0, "fold search": 0.0}
        self.row: dict[str, float] = {}
        self.summary: dict = {}
        self.volume, self.power, self.heat = simulation.volume_ledger, simulation.power_ledger, simulation.heat_ledger
        self.bodies = BodyRecord(simulation)
        self.motion = MotionRecord(simulation, self.bodies.copies)
        self.iterations, self._last_frame = 0, -1
        self.fields = self.lines = self.contact_forces = self.tool_heat = None
        if self.out is not None:
            on_rank_zero(self.comm, lambda: self._clear() if resume_after is None else None)
            self.fields = FieldWriter(self.out, self.comm, resume_after=resume_after)
            if self.heat is not None:
                from .heat_frames import ToolHeatFrames
                self.tool_heat = ToolHeatFrames(self.out, simulation.body.tools, self.comm, resume_after=resume_after)
            if simulation.lines is not None:
                self.lines = FlowLineWriter(self.out, self.comm, resume_after=resume_after)
            on_rank_zero(self.comm, lambda: (self.out / "scene.toml").write_text(self.scene.to_toml(), encoding="utf-8"))
            if simulation.body.contact is not None:
                self.contact_forces = ContactForceWriter.of(self.scene, self.out, self.comm, resume_after)
        self.tools = None
        if any(deformation.tool is not None for deformation in simulation.deforming):
            from .tool_frames import ToolFrames
            self.tools = ToolFrames(self.scene, simulation.deforming, self.out, self.comm, resume_after=resume_after)
        self.history = History.of_run(self.out, self.comm, resume_after=resume_after)
        for row in self.history.rows:
            self.bodies.damage_news(row)
        self._began, self._cpu = perf_counter(), process_time()     # the run itself: writers and their imports stand

    def _clear(self) -> None:
        """Make the folder; what another run left in it must not be taken for results of this one."""
        self.out.mkdir(parents=True, exist_ok=True)
        for name in ("history.csv", "summary.json", "checkpoint.npz"):
            (self.out / name).unlink(missing_ok=True)
        start_frames(self.out, FLOW_LINES, None)
        remove_after(self.out, -1)
        for series in self.out.glob("tool_*.pvd"):
            start_frames(self.out, series.stem, None)

    def introduction(self) -> str:
        """One line on what runs."""
        run = self.run
        return (f"{self.scene.title or 'untitled scene'} · {self.scene.geometry} · {self._cells()} cells, {self._dofs()} "
                f"degrees of freedom · {self.comm.size} rank{'s' * (self.comm.size > 1)} · built in "
                f"{run.seconds_to_build:.1f} s")

    # ------------------------------------------------------------------ a step
    def step(self, state, limited_by: str, wall: float) -> None:
        """Record an accepted step: its row, and a frame and a checkpoint where they are due."""
        self.volume.book(state.volume_changes)
        if self.heat is not None:
            self.heat.book(state.heat)
        self.row = self._row(state, wall)
        self.history.append(self.row)
        self.iterations += state.flow.iterations
        self._look_for_folds(state.step)
        self.run.contact_sizes.look(state.step, state.dt)
        if self.out is None:
            return
        start = perf_counter()
        every = self.scene.output.fields_every
        due = state.step == 0 or (every and state.step % every == 0)
        stroke = self.row.get(f"stroke_{self.scene.counting_tool}_mm", np.nan)
        if due or any(abs(stroke - s) < 1e-9 * max(1.0, s) for s in self.scene.output.strokes):
            self._frame(state)
        every = self.scene.output.checkpoint_every
        if every and state.step and state.step % every == 0:
            self.run.save(self.out / "checkpoint.npz", state)
        self.seconds["output"] += perf_counter() - start

    def news(self) -> list[str]:
        """What a user wants to hear of the last step, one sentence each."""
        said = [sentence for deformation in self.run.deforming for sentence in deformation.news()]
        return self.bodies.damage_news(self.row) + self.run.folds.news() + \
            self.run.body.solver.system.news() + said

    def _look_for_folds(self, step: int, *, now: bool = False) -> None:
        start = perf_counter()
        self.run.folds.look(self.run.body, step, now=now)
        self.seconds["fold search"] += perf_counter() - start

    def _row(self, state, wall: float) -> dict[str, float]:
        run, scene, body = self.run, self.scene, self.run.body
        unit = "N_per_mm" if scene.geometry == "plane_strain" else "N"
        row: dict[str, float] = {"step": state.step, "time_s": state.clock, "dt_s": state.dt}
        row |= equipment_columns(run, state.time)
        acts = body.share_on_the_body()
        for tool in body.tools:
            row[f"force_{tool.name}_{unit}"] = self._force(tool, acts)
        for tool in body.tools:
            if tool.motion.centre is not None:
                way = -1.0 if tool.motion.angular_velocity < 0 else 1.0
                row[f"torque_{tool.name}_Nmm"] = way * acts * body.contact.torque(tool) * self.bodies.copies()
        for deformation in run.deforming:
            row |= deformation.row()
        row |= self.bodies.contact_forces(unit, acts) | self.bodies.volumes()
        row["power_imbalance"] = self.power.imbalance(body, state.dt)
        if self.heat is not None:
            row |= self.heat.row(state.heat, "J_per_mm" if scene.geometry == "plane_strain" else "J")
        row |= self.motion.row() | self.bodies.maxima(state.history)
        row["newton_iterations"] = state.flow.iterations
        row["wall_s"] = wall
        if run.points is not None:
            row |= self._tracked(state)
        return row if self.tools is None else row | self.tools.row()

    def _tracked(self, state) -> dict[str, float]:
        """Places and state of the tracked points, for the row."""
        run, scene = self.run, self.scene
        nodal = np.column_stack([run.nodes.x, *state.history.values(), run.body.workpiece.mean_stress])
        columns = [*(f"{axis}_mm" for axis in scene.axes), *in_words(state.history), "mean_stress_MPa"]
        row = {}
        for label, (values,) in run.points.values(nodal).items():
            row |= {f"{label}_{column}": float(value) for column, value in zip(columns, values, strict=True)}
            if (temperature := self.bodies.temperature_of(label)) is not None:
                row[f"{label}_temperature_degC"] = temperature
        return row

    def force(self, name: str) -> float:
        """Force with which a tool pushes on the whole body now, positive along its working direction, N (N/mm)."""
        if name is None:        # no tool moves
            return 0.0
        tool = next(tool for tool in self.run.body.tools if tool.name == name)
        return self._force(tool, self.run.body.share_on_the_body())

    def force_to_stop_at(self) -> float:
        """:meth:`force` of the tool that counts, N, in a run that stops at one; else 0, which nobody asks for."""
        return self.force(self.scene.counting_tool) if self.scene.stop.force is not None else 0.0

    def _force(self, tool, share: float) -> float:
        """The same of a tool, with the share of it that acts on the body."""
        direction = pushing_direction(self.scene, self.run.body.tools, tool, self.run.start_extents)
        force = share * self.run.body.contact.force(tool)
        return float(force @ direction) * self.bodies.copies(direction)

    def _frame(self, state) -> None:
        if state.step == self._last_frame:
            return
        self._last_frame = state.step
        run, w = self.run, self.run.body.workpiece
        rate = np.maximum(state.flow.rate, float(w.rate0.value))
        temperature = run.body.temperature_in(state.history)
        strain = state.history["effective_strain"]
        data = {"velocity_mm_per_s": w.velocity, **in_words(state.history),
                "effective_strain_rate_per_s": state.flow.rate, "mean_stress_MPa": w.mean_stress,
                "flow_stress_MPa": np.broadcast_to(w.nodal_law(strain, rate, temperature), strain.shape),
                "contact_pressure_MPa": sum(part.nodal_pressure() for part in w.contacts)}
        if temperature is not None:
            data["temperature_degC"] = temperature
        self.fields.write(run.nodes, step=state.step, time=state.clock, point_data=data,
                          cell_data=self.bodies.cell_data())
        if self.contact_forces is not None:
            self.contact_forces.write(run.body.contact, step=state.step, time=state.clock,
                                      share=run.body.share_on_the_body())
        if self.tools is not None:
            self.tools.write(step=state.step, time=state.clock)
        if self.tool_heat is not None and state.heat is not None:
            self.tool_heat.write(step=state.step, time=state.clock, state=state.heat)
        if self.lines is not None:
            self.lines.write(step=state.step, time=state.clock, places=run.lines.places,
                             fields={name: run.lines.values(values) for name, values in in_words(state.history).items()})

    # ------------------------------------------------------------------ the end
    def doubts(self) -> list[str]:
        """What makes the results of the run doubtful, one sentence each; asked at its end. Collective."""
        self._look_for_folds(int(self.row.get("step", 0)), now=True)
        explicit = self.scene.scheme == "explicit"
        return [*self.volume.doubts("steps.scheme = 'midpoint' or smaller steps" if explicit else MORE_EXACT),
                *self.power.doubts(MORE_EXACT), *self.run.folds.doubts(), *self.run.contact_sizes.doubts(),
                *untouched(self.run, self.history.rows), *(self.heat.doubts() if self.heat is not None else [])]

    def finish(self, state, why: str, warnings: list[str]) -> None:
        """Last frame, checkpoint and summary, also of a run that failed (even in its first solve: without state).

        A disk that is too full for one of them may have room for the next: the summary is small, and says why it ended.
        """
        each_written(lambda: self._leave(state), lambda: self._sum_up(why, warnings))

    def _leave(self, state) -> None:
        start = perf_counter()
        if self.out is not None and state is not None:
            each_written(lambda: self._frame(state), lambda: self._checkpoint(state))
        self.seconds["output"] += perf_counter() - start

    def _checkpoint(self, state) -> None:
        if self.scene.output.checkpoint_every and len(self.history):
            self.history.complete()
            self.run.save(self.out / "checkpoint.npz", state)

    def _sum_up(self, why: str, warnings: list[str]) -> None:
        self.summary = self._summary(why) | {"warnings": warnings}
        if self.out is not None:
            write_summary(self.out, self.summary, self.comm)

    def results(self) -> Results:
        return Results(self.out, scene=self.scene, history=self.history, summary=self.summary)

    def _summary(self, why: str) -> dict:
        run, body, scene = self.run, self.run.body, self.scene
        wall = perf_counter() - self._began
        renewed, remeshing = ([], {}) if run.keeper is None else (run.keeper.records, run.keeper.seconds)
        parts = {**body.solver.seconds, **body.seconds, **self.seconds, **remeshing}
        if body.heat is not None:
            parts["heat"] = body.heat.seconds
        parts["other"] = max(0.0, wall - sum(parts.values()))
        solves = run.solves
        return {
            "title": scene.title, "stopped": why, "versions": versions(), "ranks": self.comm.size,
            "cells": self._cells(), "dofs": self._dofs(),
            "parts_built": self._parts(),
            "extents_mm": self.bodies.extents(),
            "ledger": {"volume": self.volume.summary(), "power": self.power.summary()} |
            self.motion.summary() | ({"damage": self.bodies.damage_summary()} if self.bodies.damage else {}) |
            ({"energy_mJ": body.rams.ledger()} if body.rams.by_tool else {}) |
            ({"heat": self.heat.summary()} if self.heat is not None else {}),
            **({"tools": self.tools.summary()} if self.tools is not None else {}),
            **({"deformation": {d.name: d.summary() for d in run.deforming}} if run.deforming else {}),
            "folds": run.folds.folds,
            "steps": int(self.row.get("step", 0)), "solves": solves, "newton_iterations": self.iterations,
            "newton_iterations_per_solve": self.iterations / max(solves, 1),
            "linear_solver": {"kind": body.solver.system.kind} | dict(body.solver.system.counts),
            "remeshings": len(renewed), "remeshed": [asdict(record) for record in renewed],
            "seconds_to_build": run.seconds_to_build, "wall_s": wall, "cpu_s": process_time() - self._cpu,
            "wall_s_by_part": parts,
            "share_outside_assembly_and_solve": 1.0 - (parts["assembly"] + parts["linear solve"]) / wall if wall else 0.0,
            "peak_memory_MB": peak_memory(self.comm),
        }

    def _parts(self) -> list[str]:
        w = self.run.body.workpiece
        friction = [f"friction {t.name}: {t.friction.law}" for t in self.run.body.tools if t.has_friction]
        terms = [f"term {name}" for name in w.terms]
        heat = [] if self.run.body.heat is None else self.run.body.heat.parts_built()
        heat += [f"tool deformation {d.name}: {d.mode}" for d in self.run.deforming]
        heat += [f"drive {t.name}: {t.drive.kind}" for t in self.run.body.tools if t.drive is not None and
                 (t.free is not None or t.name in self.run.body.rams.by_tool)]
        return terms + friction + heat + self.bodies.parts_built() + [f"scheme {self.run.scheme.name}"]

    def _cells(self) -> int:
        topology = self.run.nodes.mesh.topology
        return int(topology.index_map(topology.dim).size_global)

    def _dofs(self) -> int:
        return int(self.run.body.workpiece.space.dofmap.index_map.size_global)


@cache
def versions() -> dict[str, str]:
    """Versions of the package and of what it stands on."""
    from importlib.metadata import PackageNotFoundError, version

    import dolfinx

    from ... import __version__
    found = {"fenics_forming": __version__, "dolfinx": dolfinx.__version__}
    for name in ("numpy", "petsc4py", "gmsh"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def peak_memory(comm) -> list[float]:
    """Peak resident memory of every rank, MB."""
    import resource
    return comm.allgather(round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1))
