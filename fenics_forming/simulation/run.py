"""Where the parts meet: a scene becomes a body between its tools, and runs to its stop."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import numpy as np
from mpi4py import MPI

from ..errors import ConvergenceError, SceneError
from ..physics.bodies import body_mesh
from ..physics.nodes import Nodes
from ..physics.tools import known_tools
from ..physics.tracking import MaterialPoints
from ..process.body import FlowingBody
from ..process.placing import flowing_body, mirror_planes
from ..process.tools.free_drives import equip
from ..process.tools.machines import drives_of
from ..results.checkpoint import load_checkpoint
from ..results.files import ResultsError
from ..results.progress import Silent
from ..results.recording.contact_sizes import ContactSizes
from ..results.recording.folds import FoldRecord
from ..results.recording.ledger import PowerLedger, VolumeLedger, VolumeLedgers
from ..results.recording.recorder import Recorder
from ..results.results import Results
from ..scene import Scene, check, copies
from .checkpointing import resumed, save
from .state import State
from .stepping import Stepper
from .stops import Stops

OUTSIDE = 1e-3     # of the body: material points farther outside at the start are worth a word


class Simulation:
    """A scene made ready to run: mesh, tools, forms and solver of just what the scene names.

    Parameters
    ----------
    scene : the description
    comm : MPI communicator
    resume : a checkpoint file to go on from

    Raises
    ------
    SceneError, MeshError
        before anything is solved.
    """

    def __init__(self, scene: Scene, *, comm=MPI.COMM_WORLD, resume: Path | str | None = None):
        start = perf_counter()
        self.scene, self.comm = scene, comm
        self.warnings = check(scene)
        if scene.is_tools_alone:
            raise SceneError("there are none, nothing is formed; such a scene is run by simulate(scene)", key="workpieces")
        tools, self.drives = known_tools(scene), drives_of(scene)
        equip(scene, tools, self.drives)
        self.deforming = self._deforming(tools)
        self.saved_at, self._saved = resume, None if resume is None else load_checkpoint(resume)
        body = self._placed(tools)
        self.warnings += self._overlaps(body)
        self.start_volume = self._volume(body) if self._saved is None else self._saved.scalars["start_volume"]
        self.start_extents = np.array(body.nodes.extents()).tolist() if self._saved is None else \
            self._saved.scalars["start_extents"]
        self.volume_ledger = (VolumeLedgers if scene.is_assembled else VolumeLedger)(
            self.start_volume, restored=scene.restores_volume)
        self.power_ledger = PowerLedger()
        self.heat_ledger = self._heat_ledger(body)
        self.folds, self.contact_sizes = FoldRecord(), ContactSizes(self)
        if self._saved is not None:
            self.volume_ledger.remember(self._saved.scalars["volume_ledger"])
            self.power_ledger.remember(self._saved.scalars["power_ledger"])
            self.folds.remember(self._saved.scalars["folds"])
            self.contact_sizes.remember(self._saved.scalars["contact_sizes"])
        self.stepper = Stepper(scene, body, Stops(scene, self.drives), keeper=self._mesh_keeper(),
                               volume_ledger=self.volume_ledger, force=lambda: self._recorder.force(scene.counting_tool),
                               on_new_mesh=self._relocate)
        self.points = self._followed("points", {name: [point.at] for name, point in scene.points.items()
                                                if point.body in scene.workpieces})
        self.lines = self._followed("flow_lines", {name: np.linspace(line.from_, line.to, line.points)
                                                   for name, line in scene.flow_lines.items()})
        self.seconds_to_build = perf_counter() - start

    @property
    def body(self) -> FlowingBody:
        """What flows, on its present mesh."""
        return self.stepper.body

    @property
    def nodes(self) -> Nodes:
        """The nodes of the body's present mesh."""
        return self.body.nodes

    @property
    def scheme(self):
        """How nodes are moved in time."""
        return self.stepper.scheme

    @property
    def keeper(self):
        """What renews the mesh, or None."""
        return self.stepper.keeper

    @property
    def solves(self) -> int:
        """Velocity solves so far."""
        return self.stepper.solves

    # ------------------------------------------------------------------ building
    def _deforming(self, tools) -> list:
        """What makes tools deform or yield, their meshes included; nothing where there are none."""
        if not self.scene.yielding_tools:
            return []
        from ..process.tools.deformation import yielding_tools
        return yielding_tools(self.scene, tools, self.comm)

    def _placed(self, tools) -> FlowingBody:
        """The mesh, new or as it was saved, and what flows on it between the tools."""
        scene, saved = self.scene, self._saved
        if scene.is_assembled:
            from ..process.assembling import assemble
            body, self.mesh_size, self.mirrors = assemble(scene, tools, self.comm, saved)
            return body
        if saved is None:
            mesh, self.mesh_size = body_mesh(scene, tools, self.comm)
            self.mirrors = mirror_planes(scene, mesh)
        else:
            mesh, self.mesh_size = saved.mesh(self.comm), saved.scalars["mesh_size"]
            self.mirrors = {int(a): v for a, v in saved.scalars["mirrors"].items()}
        return flowing_body(scene, mesh, tools, self.mirrors)

    def _overlaps(self, body: FlowingBody) -> list[str]:
        """Warnings of tools or bodies from files that stand a little in one another at the start."""
        described = (*self.scene.workpieces.values(), *self.scene.tools.values())
        if self._saved is not None or all(d.shape is None or d.shape.file is None for d in described):
            return []
        from ..process.overlap import overlaps
        return overlaps(self.scene, body)

    def _heat_ledger(self, body: FlowingBody):
        """What is known of heat made and lost, where temperatures change; else None."""
        if body.heat is None:
            return None
        from ..results.recording.heat_ledger import HeatLedger

        ledger = HeatLedger(copies(self.scene))
        if self._saved is not None:
            ledger.remember(self._saved.scalars["heat_ledger"])
        return ledger

    def _volume(self, body: FlowingBody) -> float | dict[str, float]:
        """Volume of the body, mm³ (mm² in plane strain), of several by name."""
        return body.volumes() if self.scene.is_assembled else body.free_surface.volume(body.x)

    def _followed(self, group: str, at_start: dict[str, np.ndarray]) -> MaterialPoints | None:
        """Material points of a table of the scene; None where it names none."""
        if not at_start:
            return None
        saved = at_start if self._saved is None else self._saved.scalars[group]
        missing = [name for name in at_start if name not in saved]
        if missing:
            raise SceneError("the checkpoint does not follow it; resume without it", key=f"{group}.{missing[0]}")
        points = MaterialPoints(self.nodes, {name: saved[name] for name in at_start}, cells=self._hosts(group, at_start))
        self.warnings += [f"{group}.{name}: lies up to {distance.max():.2g} mm outside the body and starts at its surface"
                          for name, distance in points.distance.items() if distance.max() > OUTSIDE * self.body.size]
        return points

    def _hosts(self, group: str, names) -> dict[str, np.ndarray] | None:
        """Of several bodies, the cells that the material points of a table may lie in, by their names."""
        parts, table = self.body.parts, getattr(self.scene, group)
        return None if parts is None else {name: parts.cells_of(table[name].body) for name in names}

    def _mesh_keeper(self):
        """What renews the mesh, where the scene asks for it."""
        if all(body.remesh is None for body in self.scene.workpieces.values()):
            return None
        if self.scene.is_assembled:
            from ..process.meshes.assembly_keeper import AssemblyKeeper as MeshKeeper
        else:
            from ..process.meshes.keeper import MeshKeeper

        keeper = MeshKeeper(self.scene, mirrors=self.mirrors, mesh_size=self.mesh_size, volume=self.start_volume)
        if self._saved is not None:
            keeper.resume(self._saved.scalars["meshing"])
        return keeper

    def _relocate(self) -> None:
        """Tracked points and flow lines go on in a new mesh."""
        self.points = self.points and self.points.relocated(self.nodes, self._hosts("points", self.points.distance))
        self.lines = self.lines and self.lines.relocated(self.nodes, self._hosts("flow_lines", self.lines.distance))

    # ------------------------------------------------------------------ running
    def run(self, out: Path | str | None = None, *, observer=None) -> Results:
        """Run to the stop.

        Parameters
        ----------
        out : folder for history, fields, summary and checkpoints; without it nothing is written
        observer : hears of every step (``results.progress``)

        Raises
        ------
        ConvergenceError
            when even the shortest step fails; everything computed is in ``out`` by then.
        """
        observer, stepper = observer or Silent(), self.stepper
        last = None if self._saved is None else self._saved.scalars["step"]
        self._recorder = recorder = Recorder(self, out, resume_after=last)
        observer.started(recorder.introduction())
        for warning in self.warnings:
            observer.note(warning)
        state, why = None, "failed"
        try:
            if self._saved is None:
                state = State(0, 0.0, self.body.new_history(), self.body.rest(), 0.0)
                state = stepper.first(observer)
            else:
                state = resumed(self, self._saved)
            if self._saved is None:
                recorder.step(state, "start", 0.0)
                observer.step(recorder.row, "start")
            while (why := stepper.stops.reached(state, self.body, recorder.force_to_stop_at())) is None:
                begun = perf_counter()
                if self.keeper is not None:
                    state = stepper.on_a_fit_mesh(state, observer)
                state, limited_by = stepper.advance(state, observer)
                recorder.step(state, limited_by, perf_counter() - begun)
                observer.step(recorder.row, limited_by)
                for sentence in recorder.news():
                    observer.note(sentence)
        except (ConvergenceError, ResultsError) as failure:      # the same on every rank
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
                doubts = recorder.doubts()
                recorder.finish(stepper.renewed or state, why, [*self.warnings, *doubts])
                for doubt in doubts:
                    observer.note(f"warning: {doubt}")
        results = recorder.results()
        observer.finished(results)
        return results

    def save(self, path: Path, state: State) -> None:
        """Write the state so that a run on any number of ranks can go on from it."""
        save(self, path, state)


def simulate(scene: Scene, out: Path | str | None = None, *, observer=None, comm=MPI.COMM_WORLD) -> Results:
    """Build and run a scene; the results, which keep the scene.

    Parameters
    ----------
    scene : from ``Scene(...)`` or ``read_scene(path)``
    out : folder for the results; without it they stay in memory
    """
    return simulation_of(scene, comm=comm).run(out, observer=observer)


def simulation_of(scene: Scene, *, comm=MPI.COMM_WORLD, resume: Path | str | None = None):
    """What runs a scene: a `Simulation`; where nothing is formed a `HeatSimulation`, or a `ToolSimulation` for tools."""
    if not scene.process.flow and scene.workpieces:
        from .heat_alone import HeatSimulation
        return HeatSimulation(scene, comm=comm, resume=resume)
    if not scene.is_tools_alone:
        return Simulation(scene, comm=comm, resume=resume)
    from .tools_alone import ToolSimulation
    return ToolSimulation(scene, comm=comm, resume=resume)
