"""When a mesh is to be renewed: measured before the step, on the shape that the step will lead to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ...physics.gather import gather_cells, gather_nodal
from ...physics.parallel import highest, lowest, on_first_rank
from ...physics.remeshing import quality
from ...physics.surface import Surface
from ...scene.meshes import Remesh
from ..body import FlowingBody
from ..penetration import corner_undercut, side_penetration
from .tool_corners import left_corner


@dataclass
class Triggers:
    """The limits of a scene, and what is remembered of the last remeshing.

    settings : the scene's ``remesh`` table · dim : 2 or 3
    step : of the last remeshing · best : least quality that it gave
    """

    settings: Remesh
    dim: int
    step: int = 0
    best: float = 1.0

    def reason(self, body: FlowingBody, velocity: np.ndarray, dt: float, step: int) -> str | None:
        """Why the mesh should be renewed before the next step of ``dt``, s; None if it is good enough. Collective."""
        limits = self.settings
        if limits.every is not None and step - self.step >= limits.every:
            return f"{limits.every} steps have passed"
        if step - self.step < limits.least_steps:
            return None
        return self._shape(body, velocity, dt) or self._tools(body)

    def _shape(self, body: FlowingBody, velocity: np.ndarray, dt: float) -> str | None:
        nodes = body.nodes
        vertices, cells = self._cells(body)
        x = nodes.x + dt * velocity
        if lowest(nodes.comm, -float(quality.overturned(nodes.x, x, vertices).any())) < 0:
            return "a cell would be inverted"
        least = lowest(nodes.comm, float(quality.radius_ratio(x, vertices).min(initial=1.0)))
        # a new mesh that is not above the limit itself (a sharp wedge) is renewed when it has become clearly worse
        limit = min(self.settings.quality_limit(self.dim), 0.7 * self.best)
        if least < limit:
            return f"quality {least:.2f} is below {limit:.2f}"
        jacobian = lowest(nodes.comm, float(quality.scaled_jacobian(x, cells).min(initial=1.0)))
        if jacobian < LEAST_JACOBIAN:
            return f"a curved cell is nearly inverted (Jacobian {jacobian:.2f})"
        ratio = on_first_rank(nodes.comm, partial(quality.neighbour_ratio, gather_nodal(nodes, x), self._all_cells(body)))
        ratio = nodes.comm.bcast(ratio, 0)
        if ratio > self.settings.neighbour_ratio:
            return f"a cell is {ratio:.1f} times as large as its neighbour"
        return None

    def _tools(self, body: FlowingBody) -> str | None:
        surface = self._surface(body)
        for measure, what in ((side_penetration, "a side has sunk into '{}'"),
                              (corner_undercut, "a corner of '{}' has sunk in")):
            for name, depths in measure(surface, body.x, body.tools).items():
                if depths.worst > self.settings.penetration:
                    return f"{what.format(name)} by {depths.worst:.2f} of the element size"
        for name, away in left_corner(surface.sides, body.x, body.tools).items():
            if highest(surface.comm, away) > self.settings.penetration:
                return f"no vertex is left at a corner of '{name}'"
        return None

    def renewed(self, step: int, body: FlowingBody) -> None:
        """Remember a remeshing and the quality that it gave. Collective."""
        nodes = body.nodes
        self.step = step
        self.best = lowest(nodes.comm, float(quality.radius_ratio(nodes.x, self._cells(body)[0]).min(initial=1.0)))

    # ------------------------------------------------------------------ what is looked at
    def _cells(self, body: FlowingBody) -> tuple[np.ndarray, np.ndarray]:
        """Vertices and nodes of the owned cells."""
        return body.nodes.vertices, body.nodes.cells

    def _all_cells(self, body: FlowingBody) -> np.ndarray | None:
        """Nodes of all cells in rows, on rank 0. Collective."""
        return gather_cells(body.nodes)

    def _surface(self, body: FlowingBody) -> Surface:
        return Surface.of(body.nodes, body.workpiece.kinematics)


LEAST_JACOBIAN = 0.1    # of the scaled Jacobian of a curved cell (1: straight); 0 is inverted
