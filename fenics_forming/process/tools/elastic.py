"""A meshed tool as the deformation of its surface asks for it: compliance, and the state under forces of contact."""

from __future__ import annotations

import numpy as np

from ...physics.contact.tool_surface import ToolSurface
from ...physics.tool_body import NodalForces, ToolField
from ...physics.tool_body.memory import ToolMemory
from ...scene import Scene
from .bodies import tool_body
from .loading import LoadedTool


class ElasticTool:
    """One tool with a mesh.

    Parameters
    ----------
    name : of the tool

    Attributes
    ----------
    surface : `ToolSurface` that contact can reach · body : `ToolBody`
    at_rest : (n, dim) mm, displacements of the surface by the loads and the interference that the scene gives the tool
    """

    def __init__(self, scene: Scene, name: str, comm):
        self.loaded = LoadedTool(tool_body(scene, name, comm))
        self.meshed, self.solver, self.body = self.loaded.tool, self.loaded.solver, self.loaded.tool.body
        self.surface = ToolSurface(self.body, self.meshed.surface, self.meshed.facing)
        self.at_rest = np.zeros(self.surface.x.shape)
        if self.loaded.is_prestressed or self.meshed.loads:
            self.loaded.assemble()
            self.loaded.load(1.0)
            self.at_rest = self.displacement()
        self._accepted = self._state()

    @property
    def follows_a_tangent(self) -> bool:
        """Whether its stiffness changes: it yields, or its parts open and close."""
        return self.body.yields or bool(self.meshed.contacts)

    def compliance(self, dofs: np.ndarray) -> np.ndarray:
        """See ``tool_body.compliance``. Collective."""
        return self.solver.compliance(dofs)

    def displacement(self) -> np.ndarray:
        """Of the surface, (n, dim), mm. Collective."""
        return self.surface.from_mesh(self.body.nodal())

    def solve(self, forces: np.ndarray) -> np.ndarray:
        """Go from the accepted state to forces (n, dim), N, on the surface, its own loads kept: displacements. Collective.

        Raises
        ------
        ConvergenceError
            if it cannot carry them.
        """
        self.take_back()
        load = NodalForces(self.surface.on_mesh(forces, self.body))
        self.solver.solve([*self.meshed.loads, load], steps=1)
        return self.displacement()

    def field(self) -> ToolField:
        """Stresses and displacements of the last solve. Collective."""
        return self.loaded.field()

    def memory(self) -> ToolMemory:
        """What a resumed run goes on from, of a tool with a history. Collective."""
        self.take_back()
        return self.loaded.memory()

    def remember(self, memory: ToolMemory) -> None:
        """Take over what :meth:`memory` gave. Collective."""
        self.loaded.remember(memory)
        self.accept()

    # ------------------------------------------------------------------ going back
    def accept(self) -> None:
        """The state of the last solve is where the next ones start."""
        self._accepted = self._state()

    def take_back(self) -> None:
        """Back to the accepted state."""
        self._restore(self._accepted)

    def snapshot(self):
        """The accepted state."""
        return self._accepted

    def restore(self, accepted) -> None:
        """Take over what :meth:`snapshot` gave."""
        self._accepted = accepted
        self.take_back()

    def _state(self):
        """What a solver with a history goes on from; nothing of an elastic one, which has none."""
        return self.solver.state() if self.follows_a_tangent else None

    def _restore(self, state) -> None:
        if state is not None:
            self.solver.go_back(state)
