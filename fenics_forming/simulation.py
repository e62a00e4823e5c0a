"""Where the parts meet: a scene becomes a body between its tools, and runs to its stop."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter

import numpy as np
from mpi4py import MPI

from .errors import ConvergenceError, MeshError, SceneError
from .physics.bodies import body_mesh
from .physics.gather import scatter_cell_values, scatter_facets, scatter_nodal
from .physics.nodes import Nodes
from .physics.tools import known_tools
from .physics.tracking import MaterialPoints
from .process.integration import Flow, StepEnd
from .process.placing import flowing_body, mirror_planes
from .process.schemes import scheme_of
from .process.timestep import Adaptivity, Limit, StepChoice
from .process.tool_corners import hold_corners
from .results.checkpoint import load_checkpoint, save_checkpoint
from .results.folds import FoldRecord
from .results.ledger import PowerLedger, VolumeLedger, VolumeLedgers
from .results.progress import Silent
from .results.recorder import Recorder
from .results.results import Results
from .scene import Scene, check

OUTSIDE = 1e-3     # of the body: material points farther outside at the start are worth a word
NEAR_FORCE = 1e-3  # of a force to stop at: how exactly it is hit


@dataclass
class State:
    """Where a run is: step, time s, history of the nodes, the flow, the step length that contact looked ahead, and what
    has changed the volume in the step, mm³ by cause."""

    step: int
    time: float
    history: dict[str, np.ndarray]
    flow: Flow
    dt: float
    volume_changes: dict[str, float] = field(default_factory=dict)


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
        tools = known_tools(scene)
        self._saved = load_checkpoint(resume) if resume is not None else None
        self._place_bodies(tools)
        self.scheme = scheme_of(scene.shifting)
        self.points = self._followed("points", {name: [point.at] for name, point in scene.points.items()})
        self.lines = self._followed("flow_lines", {name: np.linspace(line.from_, line.to, line.points)
                                                   for name, line in scene.flow_lines.items()})
        self.start_volume = self._volume() if self._saved is None else self._saved.scalars["start_volume"]
        self.start_extents = np.array(self.nodes.extents()).tolist() if self._saved is None else \
            self._saved.scalars["start_extents"]
        self.volume_ledger = VolumeLedgers(self.start_volume) if scene.is_assembled else \
            VolumeLedger(self.start_volume, restored=scene.restores_volume)
        self.power_ledger = PowerLedger()
        self.folds = FoldRecord()
        if self._saved is not None:
            self.volume_ledger.remember(self._saved.scalars["volume_ledger"])
            self.power_ledger.remember(self._saved.scalars["power_ledger"])
            self.folds.remember(self._saved.scalars["folds"])
        self.keeper = self._mesh_keeper()
        self.solves = 1
        self.seconds_to_build = perf_counter() - start

    @property
    def nodes(self) -> Nodes:
        """The nodes of the body's present mesh."""
        return self.body.nodes

    # ------------------------------------------------------------------ building
    def _place_bodies(self, tools) -> None:
        """The mesh, new or as it was saved, and what flows on it between the tools."""
        scene, saved = self.scene, self._saved
        if scene.is_assembled:
            from .process.assembling import assemble
            self.body, self.mesh_size, self.mirrors = assemble(scene, tools, self.comm, saved)
            return
        if saved is None:
            mesh, self.mesh_size = body_mesh(scene, tools, self.comm)
            self.mirrors = mirror_planes(scene, mesh)
        else:
            mesh, self.mesh_size = saved.mesh(self.comm), saved.scalars["mesh_size"]
            self.mirrors = {int(a): v for a, v in saved.scalars["mirrors"].items()}
        self.body = flowing_body(scene, mesh, tools, self.mirrors)

    def _volume(self) -> float | dict[str, float]:
        """Volume of the body, mm³ (mm² in plane strain), of several by name."""
        return self.body.volumes() if self.scene.is_assembled else self.body.workpiece.volume()

    def _followed(self, group: str, at_start: dict[str, np.ndarray]) -> MaterialPoints | None:
        """Material points of a table of the scene; None where it names none."""
        if not at_start:
            return None
        saved = at_start if self._saved is None else self._saved.scalars[group]
        missing = [name for name in at_start if name not in saved]
        if missing:
            raise SceneError("the checkpoint does not follow it; resume without it", key=f"{group}.{missing[0]}")
        cells = None
        if self.body.parts is not None:
            cells = {name: self.body.parts.cells_of(getattr(self.scene, group)[name].body) for name in at_start}
        points = MaterialPoints(self.nodes, {name: saved[name] for name in at_start}, cells=cells)
        self.warnings += [f"{group}.{name}: lies up to {distance.max():.2g} mm outside the body and starts at its surface"
                          for name, distance in points.distance.items() if distance.max() > OUTSIDE * self.body.size]
        return points

    def _mesh_keeper(self):
        """What renews the mesh, where the scene asks for it."""
        if self.scene.workpiece.remesh is None:
            return None
        from .process.mesh_keeper import MeshKeeper

        keeper = MeshKeeper(self.scene, mirrors=self.mirrors, mesh_size=self.mesh_size, volume=self.start_volume)
        if self._saved is not None:
            keeper.resume(self._saved.scalars["meshing"])
        return keeper

    def _steps(self) -> StepChoice:
        scene = self.scene
        drive = scene.tools[scene.counting_tool].drive
        if scene.steps.time is not None:
            nominal = lambda t: scene.steps.time  # noqa: E731
        else:
            def nominal(t):
                drives = [drive] if drive.velocity(t).any() else self._drives     # one that rests sets no steps
                end = min(d.time_of_travel(d.travel(t) + scene.steps.stroke, t) for d in drives)
                return (end if np.isfinite(end) else max([t, *self._landmarks(drive)])) - t or np.inf
        adaptive = scene.steps.adaptive
        limits = None if adaptive is None else Adaptivity(adaptive.max_strain_increment, adaptive.tolerance)
        return StepChoice(nominal, self._landmarks(drive), limits, adaptive.min_fraction if adaptive else 1e-3)

    def _landmarks(self, drive):
        stop, strokes = self.scene.stop, list(self.scene.output.strokes)
        times = [drive.time_of_travel(s) for s in strokes + ([stop.stroke] if stop.stroke is not None else [])]
        times += self._turns
        return [t for t in times + ([stop.time] if stop.time is not None else []) if np.isfinite(t)]

    @property
    def _drives(self):
        return [self.scene.tools[name].drive for name in self.scene.driven_tools]

    @property
    def _turns(self) -> list[float]:
        """Times at which a tool starts, stops or turns back: what is recorded there is the flow before."""
        return [t for drive in self._drives for t in drive.turning_times]

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
        observer = observer or Silent()
        self.choice = self._steps()
        last = None if self._saved is None else self._saved.scalars["step"]
        self._recorder = recorder = Recorder(self, out, resume_after=last)
        observer.started(recorder.introduction())
        for warning in self.warnings:
            observer.note(warning)
        state, why = None, "failed"
        try:
            if self._saved is None:
                state = State(0, 0.0, self.body.new_history(), self.body.rest(), 0.0)
                state = self._first()
            else:
                state = self._resumed()
            if self._saved is None:
                recorder.step(state, "start", 0.0)
                observer.step(recorder.row, "start")
            while (why := self._stopped(state, recorder)) is None:
                begun = perf_counter()
                if self.keeper is not None:
                    state = self._on_a_fit_mesh(state, observer)
                state, limited_by = self._advance(state, observer)
                recorder.step(state, limited_by, perf_counter() - begun)
                observer.step(recorder.row, limited_by)
                for sentence in recorder.news():
                    observer.note(sentence)
        except ConvergenceError as failure:
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
                recorder.finish(state, why, [*self.warnings, *doubts])
                for doubt in doubts:
                    observer.note(f"warning: {doubt}")
        results = recorder.results()
        observer.finished(results)
        return results

    def _first(self) -> State:
        history = self.body.new_history()
        dt = self.choice.next(0.0).dt
        self.body.place(0.0)
        return State(0, 0.0, history, self.body.solve(0.0, history, dt, ahead=self.scheme.look_ahead), dt)

    def _resumed(self) -> State:
        saved, body, workpiece = self._saved.scalars, self.body, self.body.workpiece
        local = {name: scatter_nodal(self.nodes, values if self.comm.rank == 0 else None)
                 for name, values in self._saved.nodal.items()}
        self.choice.resume(saved["step_fraction"])
        self.scheme.remember(saved["scheme"], {name.removeprefix("scheme."): values for name, values in local.items()
                                               if name.startswith("scheme.")})
        body.speed, body.contact.reference = saved["speed"], saved["penalty"]
        body.move_tools(saved["time"])
        body.size, body.reach = saved["size"], saved["reach"]
        history = {name: local[f"history.{name}"] for name in body.new_history()}
        body.search(saved["dt"])
        if saved["at_rest"]:
            flow = body.rest()
        else:
            cellwise = {name: scatter_cell_values(self.nodes, values if self.comm.rank == 0 else None)
                        for name, values in self._saved.cellwise.items()}
            workpiece.set_start(local["velocity"], local["mean_stress"])
            workpiece.set_point_data(cellwise["stress"], cellwise["rate"], saved["rate_scale"])
            body.contact.resume(scatter_facets(self.nodes, body.contact.facets, self._saved.facetwise), local["velocity"])
            if body.interfaces is not None:
                body.interfaces.resume({name: scatter_facets(self.nodes, contact.points, self._saved.between[name])["state"]
                                        for name, contact in body.interfaces.by_name.items()}, local["velocity"])
            flow = Flow(workpiece.velocity, body.rates(history), 0)
        return State(saved["step"], saved["time"], history, flow, saved["dt"])

    def _advance(self, state: State, observer) -> tuple[State, str]:
        """One step; cut and tried again until it converges or becomes too short."""
        if state.time in self._turns:
            state = self._turned(state)
        shortened, tries = None, 0                  # a height or force to stop at is hit by secants
        fresh = self.keeper is None                 # whether a new mesh would be no cure any more
        while True:
            limit, dt, reason = self._length(state, shortened)
            body = self.body
            watched, before, scheme = self._watched(), body.snapshot(), copy.copy(self.scheme)
            try:
                reached, solves, error = self._attempt(state, dt)
            except ConvergenceError as failure:
                self._go_back(before, scheme, state.time)
                if not fresh:
                    state, fresh = self._remeshed(state, failure.sentence, observer), True
                    if self.body is not body:
                        continue
                if not self.choice.failed(state.time, limit.dt):
                    raise ConvergenceError(f"step {state.step + 1} fails however short it is: {failure.sentence}",
                                           history=failure.history, advice=failure.advice) from failure
                observer.note(f"step {state.step + 1} cut: {failure.sentence}")
                continue
            except KeyboardInterrupt:            # what is written next must belong together
                self._go_back(before, scheme, state.time)
                raise
            hit = min((dt * (wanted - then) / (now - then) for (then, wanted, near), (now, *_) in
                       zip(watched, self._watched(), strict=False) if then < wanted < now - near), default=None)
            if hit is not None and tries < 8 and dt > 1e-3 * limit.dt:      # a force may jump: then no step hits it
                tries, shortened = tries + 1, hit
                self._go_back(before, scheme, state.time)
                continue
            self.choice.succeeded(error, body.size, body.landing_share())
            self.solves += solves
            return reached, reason

    def _on_a_fit_mesh(self, state: State, observer) -> State:
        """The state on a new mesh where the present one would not do for the next step."""
        dt = self.choice.next(state.time, state.flow.rate).dt
        reason = self.keeper.reason(self.body, state.flow, dt if dt < np.inf else state.dt, state.step)
        return state if reason is None else self._remeshed(state, reason, observer)

    def _remeshed(self, state: State, reason: str, observer) -> State:
        """The state on a new mesh, and the flow there; the old ones, and a note, where that fails."""
        old = self.body
        try:
            self.body, history, flow = self.keeper.renew(
                old, self.scheme, state.history, state.flow, reason=reason, step=state.step, time=state.time,
                dt=state.dt)
        except (MeshError, ConvergenceError) as failure:
            observer.note(f"step {state.step}: the mesh stays as it is, for a new one failed: {failure}")
            return state
        self.solves += 1
        self.volume_ledger.book(self.keeper.records[-1].volume)
        self.points = self.points and self.points.relocated(self.nodes)
        self.lines = self.lines and self.lines.relocated(self.nodes)
        observer.note(f"step {state.step}: new mesh, {self.keeper.records[-1]}")
        return replace(state, history=history, flow=flow)

    def _watched(self) -> list[tuple[float, float, float]]:
        """Of all that a run stops at and a step may go past: its value, rising, that to stop at, and how near is hit."""
        stop, body, found = self.scene.stop, self.body, []
        if stop.height is not None:
            found.append((-body.height(), -stop.height, 1e-6 * stop.height))
        if stop.force is not None and not body.workpiece.is_cold:      # at first contact it jumps
            found.append((self._recorder.force(self.scene.counting_tool), stop.force, NEAR_FORCE * stop.force))
        return found

    def _length(self, state: State, shortened: float | None) -> tuple[Limit, float, str]:
        """What the steps allow, the length of the step, s, and what set it: also first contact and a wanted height."""
        body, limit = self.body, self.choice.next(state.time, state.flow.rate)
        dt = limit.dt
        if body.workpiece.is_cold:               # free travel: stop where the first tool touches
            body.search(dt)
            touch = body.time_to_contact(dt)
            if 1e-9 * dt < touch < dt:
                return limit, touch, "contact"
        elif shortened is not None or self.scene.stop.height is not None:
            reached = shortened or body.time_to_height(self.scene.stop.height, state.flow.velocity, dt)
            if reached < dt:
                return limit, max(reached, 1e-6 * dt), "target"
        return limit, dt, limit.reason

    def _attempt(self, state: State, dt: float) -> tuple[State, int, float]:
        """The state after a step of ``dt``, the solves it took, and its error estimate, mm."""
        body, scheme = self.body, self.scheme
        travels = body.workpiece.is_cold
        end = self._travel(state, dt) if travels else scheme.advance(body, state.flow, state.time, state.history, dt)
        history = end.history if travels or self.keeper is None else hold_corners(body, end.history)
        changes = {} if travels else self._account_for_volume()
        time = self.choice.end_of(state.time, dt)
        turns = time in self._turns
        ahead = dt if turns else self.choice.next(time, state.flow.rate).dt
        ahead = ahead if 0 < ahead < np.inf else dt
        body.move_tools(time - 1e-12 * dt if turns else time)
        flow = body.solve(time, history, ahead, ahead=self.scheme.look_ahead)
        flow = replace(flow, iterations=flow.iterations + end.iterations)
        return State(state.step + 1, time, history, flow, ahead, changes), 1 + end.solves, end.error

    def _account_for_volume(self) -> dict[str, float]:
        """Changes of volume, by cause, at the end of a step, where the volume is restored if that is asked for."""
        if self.scene.is_assembled:
            return {name: {"corners": change} for name, change in self.body.returned_volumes().items()}
        changes = {"corners": self.body.returned_volume()}
        if self.volume_ledger.restored:
            changes["given back"] = self.body.restore_volume(self.start_volume).given_back
        return changes

    def _turned(self, state: State) -> State:
        """The state with the flow after the tools have turned; what follows knows nothing of the one before."""
        before = self.body.snapshot()
        self.body.move_tools(state.time)
        ahead = self.choice.next(state.time, state.flow.rate).dt
        try:
            flow = self.body.solve(state.time, state.history, ahead if ahead < np.inf else state.dt,
                                   ahead=self.scheme.look_ahead)
        except ConvergenceError:
            self._go_back(before, self.scheme, state.time)
            raise
        self.solves += 1
        self.scheme = scheme_of(self.scene.shifting)
        return replace(state, flow=flow)

    def _travel(self, state: State, dt: float):
        """The tools move on, the body rests; what follows knows nothing of the flow before."""
        self.scheme = scheme_of(self.scene.shifting)
        self.body.place(state.time + dt)
        return StepEnd(state.history, 0, 0, None, 0.0)

    def _go_back(self, before: tuple, scheme, time: float) -> None:
        self.body.restore(before)
        self.scheme = scheme
        self.body.move_tools(time)

    def _stopped(self, state: State, recorder: Recorder) -> str | None:
        """Why the run is over, or None."""
        stop, scene = self.scene.stop, self.scene
        drive = scene.tools[scene.counting_tool].drive
        if stop.stroke is not None and drive.travel(state.time) >= stop.stroke * (1 - 1e-9):
            return f"stroke {stop.stroke:g} mm reached"
        if stop.time is not None and state.time >= stop.time * (1 - 1e-9):
            return f"time {stop.time:g} s reached"
        if stop.force is not None and recorder.force(scene.counting_tool) >= stop.force * (1 - NEAR_FORCE):
            return f"force {stop.force:g} N reached"
        if stop.height is not None and self.body.height() <= stop.height * (1 + 1e-6):
            return f"height {stop.height:g} mm reached"
        end = stop.time or (np.inf if stop.stroke is None else drive.time_of_travel(stop.stroke, state.time))
        if end == np.inf and state.time >= max(self._turns, default=0.0):
            self.body.move_tools(state.time)
            self.body.search(state.dt)
            if self.body.time_to_contact(np.inf) == np.inf and not self.body.is_pushed(state.dt):
                return "no tool comes towards the body any more: the stop was not reached"
        return None

    # ------------------------------------------------------------------ checkpoints
    def save(self, path: Path, state: State) -> None:
        """Write the state so that a run on any number of ranks can go on from it."""
        w, contact = self.body.workpiece, self.body.contact
        numbers, remembered = self.scheme.memory()
        save_checkpoint(path, self.nodes, scalars={
            "step": state.step, "time": state.time, "dt": state.dt, "speed": self.body.speed,
            "mesh_size": self.mesh_size, "mirrors": _with_words(self.mirrors), "bodies": self.body.making(),
            "points": _listed(self.points), "flow_lines": _listed(self.lines),
            "start_volume": self.start_volume, "start_extents": self.start_extents,
            "volume_ledger": self.volume_ledger.memory(),
            "power_ledger": self.power_ledger.memory(), "folds": self.folds.memory(),
            "at_rest": w.is_cold, "penalty": contact.reference,
            "rate_scale": 1.0 if w.last_rate is None else w.last_rate[1], "step_fraction": self.choice.fraction,
            "size": self.body.size, "reach": self.body.reach, "scheme": numbers,
            "meshing": None if self.keeper is None else self.keeper.memory()},
            nodal={"velocity": w.velocity, "mean_stress": w.mean_stress,
                   **{f"history.{name}": values for name, values in state.history.items()},
                   **{f"scheme.{name}": values for name, values in remembered.items()}},
            cellwise=dict(zip(("stress", "rate"), w.point_data(), strict=True)),
            facetwise=contact.memory(), facets=contact.facets, between=self.body.between())


def _with_words(table: dict) -> dict:
    """The same nested tables with words for keys, as JSON has them."""
    return {str(key): _with_words(value) if isinstance(value, dict) else value for key, value in table.items()}


def _listed(points: MaterialPoints | None) -> dict[str, list]:
    return {} if points is None else {name: places.tolist() for name, places in points.places.items()}


def simulate(scene: Scene, out: Path | str | None = None, *, observer=None, comm=MPI.COMM_WORLD) -> Results:
    """Build and run a scene; the results, which keep the scene.

    Parameters
    ----------
    scene : from ``Scene(...)`` or ``read_scene(path)``
    out : folder for the results; without it they stay in memory
    """
    return Simulation(scene, comm=comm).run(out, observer=observer)
