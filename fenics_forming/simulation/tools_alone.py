"""Tools alone: put together, loaded step by step, looked at after every step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

from ..errors import ConvergenceError
from ..physics.tool_body import ToolSettings
from ..physics.tracking import MaterialPoints
from ..process.tools.bodies import MeshedTool, tool_body
from ..process.tools.loading import LoadedTool
from ..results.files import ResultsError
from ..results.progress import Silent
from ..results.recording.tool_recorder import ToolRecorder
from ..results.results import Results
from ..scene import Scene, check
from .tool_checkpoints import resumed, save, saved_step


@dataclass(frozen=True)
class Stage:
    """A step of a run of tools alone: what each `LoadedTool` does, with what (of each by name, or of all), the load factor
    that is then reached, a word for the table, and the time, s, of the state whose loads are meant."""

    action: Callable
    wanted: float | dict
    level: float
    word: str
    time: float = 0.0


STEPS = 10       # to the full loads, where the way there matters and the scene does not say how many


class ToolSimulation:
    """A scene of deformable tools made ready to run.

    Parameters
    ----------
    scene : the description, without workpieces
    comm : MPI communicator
    tools : name → `MeshedTool`, of tools that are meshed and loaded already
    resume : a checkpoint file to go on from
    path : (time in s, name → loads) of states that the tools go through one after the other instead of load factors

    Raises
    ------
    SceneError, MeshError
        before anything is solved.
    """

    def __init__(self, scene: Scene, *, comm=MPI.COMM_WORLD, tools: dict[str, MeshedTool] | None = None, path=(),
                 resume: Path | str | None = None):
        start = perf_counter()
        self._path, self._saved = list(path), None if resume is None else Path(resume)
        self.scene, self.comm, self.warnings = scene, comm, check(scene)
        meshed = {name: tool_body(scene, name, comm) for name in scene.tools} if tools is None else tools
        self.tools = {name: self._loaded(tool, scene.solver) for name, tool in meshed.items()}
        self.points = {name: points for name, tool in self.tools.items() if (points := self._followed(tool)) is not None}
        self.seconds_to_build = perf_counter() - start

    @staticmethod
    def _loaded(tool, solver) -> LoadedTool:
        settings = ToolSettings(max_iterations=solver.max_iterations) if solver.says("max_iterations") else ToolSettings()
        numbers = {"penalty_factor": solver.penalty_factor} if tool.contacts else {}
        if tool.contacts and not solver.augmented:
            numbers["augmentations"] = 0
        return LoadedTool(tool, settings, **numbers)

    def _followed(self, tool: LoadedTool) -> MaterialPoints | None:
        """The points of the scene in the bodies of a tool; None where there are none."""
        parts = tool.tool.parts
        at = {name: [point.at] for name, point in self.scene.points.items() if point.body in parts.names}
        cells = {name: parts.cells_of(self.scene.points[name].body) for name in at}
        return MaterialPoints(tool.tool.body.nodes, at, cells=cells) if at else None

    def contacts(self, name: str) -> dict:
        """The contacts between the parts of a tool, by the names of both."""
        tool = self.tools[name]
        return dict(zip(tool.tool.contact_names, getattr(tool.solver, "contacts", ()), strict=True))

    @property
    def cells(self) -> int:
        """Number of cells of all tools."""
        return sum(sum(tool.tool.parts.counts) for tool in self.tools.values())

    @property
    def dofs(self) -> int:
        """Number of displacements of all tools."""
        spaces = [tool.tool.body.space for tool in self.tools.values()]
        return sum(int(space.dofmap.index_map.size_global * space.dofmap.index_map_bs) for space in spaces)

    def parts_built(self) -> list[str]:
        """What was built, as words."""
        found = []
        for name, tool in self.tools.items():
            body = tool.tool.body
            found.append(f"tool {name}: {'elastic-plastic' if body.yields else 'elastic'}, {body.state.name}")
            found += [f"springs {name}"] if body.spread_springs() else []
        found += [f"contact {contact.name}: {contact.friction.law}" for contact in self.scene.contacts]
        return found

    # ------------------------------------------------------------------ running
    def levels(self) -> list[float]:
        """Load factors to go through."""
        wanted = self.scene.steps.loads if self.scene.steps is not None else None
        if isinstance(wanted, tuple):
            return list(wanted)
        count = wanted or (STEPS if any(tool.is_stepwise for tool in self.tools.values()) else 1)
        return [k / count for k in range(1, count + 1)]

    def run(self, out: Path | str | None = None, *, observer=None) -> Results:
        """Put the tools together, then load them step by step.

        Interference and given displacements are brought on first, before any load; in a scene without loads they are what
        is brought on step by step.

        Parameters
        ----------
        out : folder for history, fields and summary; without it nothing is written
        observer : hears of every step (``results.progress``)

        Raises
        ------
        ConvergenceError
            when a tool cannot carry its loads; everything up to there is in ``out`` by then.
        """
        observer = observer or Silent()
        after = None if self._saved is None else saved_step(self._saved)
        self._recorder = recorder = ToolRecorder(self, out, resume_after=after)
        observer.started(recorder.introduction())
        for warning in self.warnings:
            observer.note(warning)
        why, self._step, self._time = None, 0, 0.0
        try:
            stages = self._stages()
            if self._saved is None:
                self._record(0.0, "start", perf_counter(), observer)
            else:
                self._step = resumed(self, self._saved, stages)
            for stage in stages[self._step:]:
                self._go(stage, observer)
                self._save_where_due(out, last=self._step == len(stages))
            why = "full loads reached" if self._is_loaded else "assembled"
        except (ConvergenceError, ResultsError) as failure:      # the same on every rank
            why = f"failed: {failure}"
            raise
        except KeyboardInterrupt:
            why = "interrupted"
            raise
        except Exception as error:
            why = f"failed: {error!r}" if self.comm.size == 1 else None
            raise
        finally:
            if why is not None:
                doubts = recorder.doubts()
                recorder.finish(why, [*self.warnings, *doubts])
                for doubt in doubts:
                    observer.note(f"warning: {doubt}")
        results = recorder.results()
        observer.finished(results)
        return results

    @property
    def _is_loaded(self) -> bool:
        return bool(self._path) or any(tool.tool.loads for tool in self.tools.values())

    def _stages(self) -> list[Stage]:
        """The steps of the run: put together, where that stresses anything, then load by load."""
        if not self._is_loaded:
            return [Stage(LoadedTool.assemble, level, level, "assembly") for level in self.levels()]
        first = [Stage(LoadedTool.assemble, 1.0, 0.0, "assembled")] if any(
            tool.is_prestressed for tool in self.tools.values()) else []
        if self._path:
            return first + [Stage(LoadedTool.change_loads, loads, 1.0, "load", time) for time, loads in self._path]
        return first + [Stage(LoadedTool.load, level, level, "load") for level in self.levels()]

    def _go(self, stage: Stage, observer) -> None:
        """One step of all tools; where one fails, what it still carries is recorded before the news goes on."""
        begun, cuts, level = perf_counter(), self._cuts(), stage.level
        self._step += 1
        self._time = stage.time
        failure = None
        for name, tool in self.tools.items():
            try:
                stage.action(tool, stage.wanted[name] if isinstance(stage.wanted, dict) else stage.wanted)
            except ConvergenceError as error:
                failure = failure or error
                level = tool.level if stage.action is LoadedTool.load else level
        if self._cuts() > cuts:
            observer.note(f"step {self._step}: cut back {self._cuts() - cuts} times")
        self._record(level, stage.word if failure is None else "failure", begun, observer)
        if failure is not None:
            raise failure

    def _save_where_due(self, out, *, last: bool) -> None:
        every = self.scene.output.checkpoint_every
        if out is not None and every and (last or self._step % every == 0):
            save(self, Path(out), self._step)

    def _cuts(self) -> int:
        return sum(tool.solver.cuts for tool in self.tools.values())

    def _record(self, level: float, word: str, begun: float, observer) -> None:
        time = {"time_s": self._time} if self._path else {}
        self._recorder.step(self._step, time | {"load_factor": level}, perf_counter() - begun)
        observer.step(self._recorder.row, word)
