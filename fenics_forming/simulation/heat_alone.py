"""Heat alone: a body that cools or warms where it lies, until a time. No velocities are known here, and none are built."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import numpy as np
from mpi4py import MPI

from ..physics.bodies import body_mesh
from ..physics.contact.rigid import ToolMotion
from ..physics.gather import scatter_nodal
from ..physics.kinematics import KINDS
from ..physics.nodes import Nodes
from ..physics.tools import known_tools
from ..physics.tracking import MaterialPoints
from ..process.heat.building import body_heat, heat_of_bodies
from ..process.placing import free_facets, mirror_planes
from ..process.timestep import StepChoice
from ..results.checkpoint import load_checkpoint, save_checkpoint
from ..results.files import ResultsError
from ..results.progress import Silent
from ..results.recording.heat_ledger import HeatLedger
from ..results.recording.heat_recorder import HeatRecorder
from ..results.results import Results
from ..scene import Scene, check, copies
from .checkpointing import with_words


class HeatSimulation:
    """A scene without flow made ready to run.

    Parameters
    ----------
    scene : the description, with ``process.flow = false``
    comm : MPI communicator
    resume : a checkpoint file to go on from

    Raises
    ------
    SceneError, MeshError
        before anything is solved.
    """

    def __init__(self, scene: Scene, *, comm=MPI.COMM_WORLD, resume: Path | str | None = None):
        start = perf_counter()
        self.scene, self.comm, self.warnings = scene, comm, check(scene)
        self.tools = known_tools(scene)
        for tool in self.tools:
            tool.motion = ToolMotion(np.zeros(scene.dimension), np.zeros(scene.dimension))
        self._saved = load_checkpoint(resume) if resume is not None else None
        self.parts, self._bodies = None, None
        self.heat = self._assembled() if scene.is_assembled else self._single()
        self.nodes, self.ledger = self.heat.field.nodes, HeatLedger(copies(scene))
        cells = None if self.parts is None else {name: self.parts.cells_of(p.body) for name, p in scene.points.items()}
        self.points = MaterialPoints(self.nodes, {name: [point.at] for name, point in scene.points.items()}, cells=cells) \
            if scene.points else None
        self.seconds_to_build = perf_counter() - start

    def _single(self):
        """The heat of the one body."""
        scene, saved = self.scene, self._saved
        if saved is None:
            mesh, _ = body_mesh(scene, self.tools, self.comm)
            self._mirrors = mirror_planes(scene, mesh)
        else:
            mesh, self._mirrors = saved.mesh(self.comm), {int(a): v for a, v in saved.scalars["mirrors"].items()}
        nodes = Nodes(mesh)
        return body_heat(scene, nodes, KINDS[scene.geometry], free_facets(nodes, self._mirrors, scene.axes), self.tools)

    def _assembled(self):
        """The heat of several bodies."""
        from ..physics.assembly import assembled_mesh
        from ..physics.parts import Parts
        from ..process.assembling import boundary_of, finer_bodies, mirror_planes_of
        scene, saved = self.scene, self._saved
        if saved is None:
            mesh, _, counts = assembled_mesh(scene, self.tools, self.comm)
        else:
            mesh, counts = saved.mesh(self.comm), saved.scalars["bodies"]["cells"]
        self.parts = parts = Parts(Nodes(mesh), scene.workpieces, counts)
        if saved is None:
            self._mirrors = mirror_planes_of(scene, parts)
        else:
            self._mirrors = {name: {int(a): v for a, v in planes.items()}
                             for name, planes in saved.scalars["mirrors"].items()}
        free, _ = boundary_of(parts, self._mirrors, scene.axes)
        slaves = finer_bodies(scene, parts.nodes, free) if saved is None else saved.scalars["bodies"]["slaves"]
        self._bodies = {"cells": parts.counts, "slaves": slaves}
        return heat_of_bodies(scene, parts, KINDS[scene.geometry], free, self.tools, slaves)

    # ------------------------------------------------------------------ running
    def run(self, out: Path | str | None = None, *, observer=None) -> Results:
        """Run to the time at which the scene stops.

        Parameters
        ----------
        out : folder for history, fields, summary and checkpoints; without it nothing is written
        observer : hears of every step (``results.progress``)
        """
        observer, stop = observer or Silent(), self.scene.stop.time
        self.step, self.time = 0, 0.0
        given = [body.temperature for body in self.scene.workpieces.values()]
        start = np.full(self.nodes.count, given[0]) if self.parts is None else self.parts.nodal(given)
        self.history = {"temperature": start}
        self.state = self.heat.first()
        if self._saved is not None:
            self._resume()
        recorder = HeatRecorder(self, out, resume_after=None if self._saved is None else self.step)
        observer.started(recorder.introduction())
        for warning in self.warnings:
            observer.note(warning)
        if self._saved is None:
            recorder.step(0.0, 0.0)
            observer.step(recorder.row, "start")
        steps, why = StepChoice(lambda time: self.scene.steps.time, [stop]), "failed"
        try:
            while self.time < stop * (1 - 1e-9):
                begun, limit = perf_counter(), steps.next(self.time)
                self.history, self.state = self.heat.advance(self.history, self.history, self.state, self.tools, limit.dt)
                self.step, self.time = self.step + 1, steps.end_of(self.time, limit.dt)
                recorder.step(limit.dt, perf_counter() - begun)
                observer.step(recorder.row, limit.reason)
            why = f"time {stop:g} s reached"
        except ResultsError as failure:          # the same on every rank
            why = f"failed: {failure}"
            raise
        except KeyboardInterrupt:
            why = "interrupted"
            raise
        except Exception as error:               # of several ranks maybe on one only: the others would not come to write
            why = f"failed: {error!r}" if self.comm.size == 1 else None
            raise
        finally:
            if why is not None:
                recorder.finish(why, self.warnings)
        results = recorder.results()
        observer.finished(results)
        return results

    # ------------------------------------------------------------------ checkpoints
    def save(self, path: Path) -> None:
        """Write the state so that a run on any number of ranks can go on from it. Collective."""
        rates = {"temperature": self.state.drift}
        save_checkpoint(path, self.nodes,
                        scalars={"step": self.step, "time": self.time, "heat_ledger": self.ledger.memory(),
                                 "heat_tools": self.heat.tool_memory(self.state),
                                 "mirrors": with_words(self._mirrors), "bodies": self._bodies},
                        nodal={"temperature": self.history["temperature"], **self.heat.saved(self.state, rates)})

    def _resume(self) -> None:
        saved = self._saved
        local = {name: scatter_nodal(self.nodes, values if self.comm.rank == 0 else None)
                 for name, values in saved.nodal.items()}
        self.step, self.time = saved.scalars["step"], saved.scalars["time"]
        self.ledger.remember(saved.scalars["heat_ledger"])
        self.history = {"temperature": local["temperature"]}
        self.state, _ = self.heat.resumed(local, saved.scalars["heat_tools"])
