"""Keeps the mesh of a run fit: renews it when it is due, and puts the body with its history and flow on the new one."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np

from ...errors import ConvergenceError, MeshError
from ...physics.gather import scatter_nodal
from ...scene import Scene
from ..body import FlowingBody
from ..integration import Flow, Scheme
from ..placing import flowing_body
from .adaptation import adapted_sizes
from .renewing import Carried, Renewed, renew
from .triggers import Triggers

# Of the mesh size, where the scene gives no min_size. Lips and notches at the ends of contact are as small as the elements
# there; following them by finer ones would make smaller lips, and sides that the flow turns over within a step.
FINEST_SIDE = 0.3
QUADRATIC = ("velocity", "positions")     # of what a scheme remembers; all else is as smooth as a rate


@dataclass(frozen=True)
class Record:
    """A remeshing that was done: after which step, time s, why, cells before and after, what made the mesh, what of the
    old boundary could not be kept, changes of volume by cause (of several bodies by name) mm³, relative change of the
    integrals of the history, force of every tool before and after N, s, least ratio of radii of the new cells."""

    step: int
    time: float
    reason: str
    cells: tuple[int, int]
    engine: str
    healed: tuple[str, ...]
    volume: dict[str, float]
    conservation: dict[str, float]
    forces: tuple[list[float], list[float]]
    seconds: float
    quality: float

    def __str__(self):
        return "; ".join([f"{self.cells[0]} to {self.cells[1]} cells ({self.engine}): {self.reason}", *self.healed])


class MeshKeeper:
    """Renews the mesh of the workpiece of a scene whose ``remesh`` table asks for it.

    Parameters
    ----------
    mirrors : axis → coordinate of the mirror planes
    mesh_size : of the first mesh, mm
    volume : of the body at the start, mm³
    """

    def __init__(self, scene: Scene, *, mirrors: dict[int, float], mesh_size: float, volume: float):
        self._scene, self._mirrors = scene, mirrors
        self.settings = scene.workpiece.remesh
        self._kept_volume = volume if scene.process.volume_constancy else None
        self._mesh_size = mesh_size
        self.triggers = Triggers(self.settings, scene.dimension)
        self.records: list[Record] = []
        self.seconds = {"remeshing": 0.0}

    def memory(self) -> dict:
        """What a later run goes on from, as JSON can hold it."""
        return {"step": self.triggers.step, "best": self.triggers.best, "records": [asdict(r) for r in self.records]}

    def resume(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        self.triggers.step, self.triggers.best = memory["step"], memory["best"]
        self.records = [Record(**record) for record in memory["records"]]

    def reason(self, body: FlowingBody, flow: Flow, dt: float, step: int) -> str | None:
        """Why the mesh should be renewed before the next step, of ``dt`` s; None if it need not. Collective."""
        if body.workpiece.is_cold:
            return None
        return self.triggers.reason(body, flow.velocity, dt, step)

    def renew(self, body: FlowingBody, scheme: Scheme, history: dict, flow: Flow, *, reason: str, step: int, time: float,
              dt: float) -> tuple[FlowingBody, dict, Flow]:
        """Body, history and flow on a new mesh; ``scheme`` goes on with its memory there. Collective.

        Raises
        ------
        MeshError, ConvergenceError
            if no mesh can be made, or no flow found on it; the body is as it was then.
        """
        numbers, remembered = scheme.memory()
        made = self._made(body, _carried(body, history, flow, remembered))
        pressed = [(tool.state, tool.traction) for tool in body.tools]
        forces = _forces(body)
        try:
            new = self._body_on(made, body)
            local = _scattered(new, made)
            old, history, conserved = history, {name: local[f"history.{name}"] for name in history}, made.conservation
            if new.heat is not None:
                history, change = new.heat.continues(body.heat, old, history)
                conserved = conserved | {"heat": change}
            flow = _flow(new, body, history, local, time, dt, scheme.look_ahead)
        except (MeshError, ConvergenceError):
            for tool, (state, traction) in zip(body.tools, pressed, strict=True):
                tool.state, tool.traction = state, traction
            raise
        scheme.remember(numbers, {name: local[f"scheme.{name}"] for name in remembered})
        self._renewed(step, new)
        self.seconds["remeshing"] += made.seconds
        self.records.append(Record(step, time, reason, made.cells, made.engine, made.healed, made.volume, conserved,
                                   (forces, _forces(new)), made.seconds, self._best()))
        return new, history, flow

    # ------------------------------------------------------------------ what it is of
    def _made(self, body: FlowingBody, carried: Carried) -> Renewed:
        return renew(body, carried, mirrors=self._mirrors, **self.wishes(body.tools))

    def _body_on(self, made: Renewed, before: FlowingBody) -> FlowingBody:
        return flowing_body(self._scene, made.mesh, before.tools, self._mirrors)

    def _renewed(self, step: int, body: FlowingBody) -> None:
        self.triggers.renewed(step, body)

    def _best(self) -> float:
        return self.triggers.best

    def wishes(self, tools) -> dict:
        """What a new mesh must be like, as `remeshing.renew` takes it."""
        return {"sizes": partial(self._sizes, tools), "chord": self.settings.chord, "least": self._least(),
                "hover": self.settings.penetration, "engine": self.settings.engine, "kept_volume": self._kept_volume}

    def _least(self) -> float:
        """The finest sides that curvature, chord and short runs of the boundary may ask for, mm."""
        settings = self.settings
        return FINEST_SIDE * (settings.max_size or self._mesh_size) if settings.min_size is None else settings.min_size

    def _sizes(self, tools, body, labels, fields):
        """Wanted sizes of the elements of a whole body, on one rank."""
        return adapted_sizes(self._scene, tools, body, labels, self._mirrors, self._mesh_size,
                             strain_rate=fields["rate"], temperature=fields.get("history.temperature"))


def _carried(body: FlowingBody, history: dict, flow: Flow, remembered: dict) -> Carried:
    """What the new mesh needs: history, flow and contact pressures for the start of the solve, memory of the scheme."""
    w = body.workpiece
    carried = Carried({f"history.{name}": values for name, values in history.items()}, {"velocity": flow.velocity})
    carried.linear |= {"mean_stress": w.mean_stress, "rate": flow.rate}
    if body.inertia is not None:
        carried.quadratic |= {"before.velocity": body.inertia.before.velocity, "now.velocity": body.inertia.velocity}
    for tool in body.tools:
        pressure = body.contact.facets.loaded_to_nodes(tool.state.pressure, body.contact.weights)
        carried.linear[f"pressure.{tool.name}"] = pressure
    if body.interfaces is not None:
        carried.linear |= {f"between.{name}": values for name, values in body.interfaces.nodal_pressures().items()}
    for name, values in remembered.items():
        (carried.quadratic if name in QUADRATIC else carried.linear)[f"scheme.{name}"] = values
    return carried


def _scattered(body: FlowingBody, made: Renewed) -> dict[str, np.ndarray]:
    """The carried fields at the nodes of this rank; linear ones with the mean of their edge at mid-nodes."""
    comm, nodes = body.nodes.comm, body.nodes
    names = comm.bcast(None if made.fields is None else list(made.fields), 0)
    local = {name: scatter_nodal(nodes, None if made.fields is None else made.fields[name]) for name in names}
    return {name: values if name.split(".")[-1] in QUADRATIC else nodes.with_mids(values) for name, values in local.items()}


def _flow(new: FlowingBody, old: FlowingBody, history: dict, local: dict, time: float, dt: float,
          ahead: float) -> Flow:
    """The flow on the new mesh, from the one on the old."""
    new.continues(old)
    if new.inertia is not None:
        new.inertia.continues(old.inertia, local["before.velocity"], local["now.velocity"], local["velocity"])
    new.place(time)
    new.search(ahead * dt)
    w, rate_scale = new.workpiece, old.workpiece.last_rate[1]
    w.guess(local["velocity"], local["mean_stress"], local["rate"], rate_scale)
    new.contact.resume_from_nodes({t.name: local[f"pressure.{t.name}"] for t in new.tools}, local["velocity"], new.reach)
    if new.interfaces is not None:
        new.interfaces.resume_from_nodes({name: local[f"between.{name}"] for name in new.interfaces.names},
                                         local["velocity"])
    found = new.solve(time, history, dt, ahead=ahead)
    if new.nodes.dim < 3 or new.inertia is not None or new.solver.border is not None:
        return found
    # nodal means of the pressure are poor multipliers: in space the force is 1 % off with them, and not with its own
    again = new.solve(time, history, dt, ahead=ahead)
    return replace(again, iterations=found.iterations + again.iterations)


def _forces(body: FlowingBody) -> list[float]:
    """Size of the force of every tool, N; in axisymmetry of that along the axis."""
    return np.linalg.norm(body.contact.resultants(), axis=1).tolist()
