"""Keeps the meshes of several bodies fit: renews those that are due, and leaves the others as they are."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from ...physics.facets import exterior_facets
from ...physics.gather import gather_cell_values, gather_cells
from ...physics.surface import Surface, facet_sides
from ...scene import Scene
from ..assembling import assembled_body
from ..body import FlowingBody
from ..integration import Flow
from .assembly import renew_bodies
from .keeper import MeshKeeper, Record
from .renewing import Carried, Renewed
from .triggers import Triggers


class PartTriggers(Triggers):
    """`Triggers` of one body among several.

    name : of the body
    """

    name: str = ""

    def _cells(self, body: FlowingBody) -> tuple[np.ndarray, np.ndarray]:
        own = body.parts.cells_of(self.name)
        return body.nodes.vertices[own], body.nodes.cells[own]

    def _all_cells(self, body: FlowingBody) -> np.ndarray | None:
        cells, of_cell = gather_cells(body.nodes), gather_cell_values(body.nodes, body.parts.of_cell)
        return None if cells is None else cells[of_cell == body.parts.names.index(self.name)]

    def _surface(self, body: FlowingBody) -> Surface:
        sides = facet_sides(body.nodes, body.parts.facets_of(self.name, exterior_facets(body.nodes.mesh)))
        return Surface(sides, body.x, body.workpiece.kinematics, nodes=body.nodes)


class AssemblyKeeper(MeshKeeper):
    """Renews the meshes of the workpieces that have a ``remesh`` table.

    Parameters
    ----------
    mirrors : body → axis → coordinate of its mirror planes
    mesh_size : of the first mesh of each body, mm · volume : body → mm³ at the start
    """

    def __init__(self, scene: Scene, *, mirrors: dict[str, dict[int, float]], mesh_size: list[float],
                 volume: dict[str, float]):
        self._scene, self._mirrors = scene, mirrors
        self._of: dict[str, MeshKeeper] = {}
        for (name, body), size in zip(scene.workpieces.items(), mesh_size, strict=True):
            if body.remesh is not None:
                self._of[name] = keeper = MeshKeeper(scene.alone(name), mirrors=mirrors[name], mesh_size=size,
                                                     volume=volume[name])
                keeper.triggers = PartTriggers(body.remesh, scene.dimension)
                keeper.triggers.name = name
        self._due, self._asked = list(self._of), None
        self.records: list[Record] = []
        self.seconds = {"remeshing": 0.0}

    def memory(self) -> dict:
        """See `MeshKeeper.memory`."""
        return {"bodies": {name: keeper.memory() for name, keeper in self._of.items()},
                "records": [asdict(record) for record in self.records]}

    def resume(self, memory: dict) -> None:
        """Take over what :meth:`memory` gave."""
        for name, keeper in self._of.items():
            keeper.resume(memory["bodies"][name])
        self.records = [Record(**record) for record in memory["records"]]

    def reason(self, body: FlowingBody, flow: Flow, dt: float, step: int) -> str | None:
        """Why meshes should be renewed before the next step, of ``dt`` s; None if none need. Collective."""
        found = {name: keeper.reason(body, flow, dt, step) for name, keeper in self._of.items()}
        found = {name: why for name, why in found.items() if why is not None}
        self._due, self._asked = list(found), "; ".join(f"'{name}': {why}" for name, why in found.items()) or None
        return self._asked

    def renew(self, body, scheme, history, flow, *, reason, **more):
        """See `MeshKeeper.renew`; all meshes are renewed where another ``reason`` is given than was found before."""
        if reason != self._asked:
            self._due = list(self._of)
        self._asked = None
        return super().renew(body, scheme, history, flow, reason=reason, **more)

    # ------------------------------------------------------------------ what it is of
    def _made(self, body: FlowingBody, carried: Carried) -> Renewed:
        return renew_bodies(body, carried, {name: self._of[name].wishes(body.tools) for name in self._due}, self._mirrors,
                            {contact.name: contact.between for contact in self._scene.contacts})

    def _body_on(self, made: Renewed, before: FlowingBody) -> FlowingBody:
        making = before.making()
        return assembled_body(self._scene, made.mesh, before.tools, self._mirrors, made.counts, making["slaves"])

    def _renewed(self, step: int, body: FlowingBody) -> None:
        for name in self._due:
            self._of[name].triggers.renewed(step, body)

    def _best(self) -> float:
        return min(self._of[name].triggers.best for name in self._due)
