"""Deformed tools of a forming run: a frame of each beside every frame of the workpiece, points in them, their summary."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...physics.tracking import MaterialPoints
from .fields import FieldWriter
from .tool_fields import part_numbers, point_data, tracked


class ToolFrames:
    """The tools of a run that are meshed.

    Parameters
    ----------
    deforming : `Deformation`s of the run, those of rigid tools on a press frame among them
    folder : of the run, None where nothing is written · resume_after : step after which a resumed run goes on
    """

    def __init__(self, scene, deforming, folder: Path | None, comm, *, resume_after: int | None = None):
        self.scene = scene
        self.tools = [deformation for deformation in deforming if deformation.tool is not None]
        self._writers = {} if folder is None else {
            d.name: FieldWriter(folder, comm, series=series_of(d.name), resume_after=resume_after) for d in self.tools}
        self._points = {d.name: points for d in self.tools if (points := self._followed(d)) is not None}

    def _followed(self, deformation) -> MaterialPoints | None:
        parts = deformation.tool.meshed.parts
        at = {name: [point.at] for name, point in self.scene.points.items() if point.body in parts.names}
        cells = {name: parts.cells_of(self.scene.points[name].body) for name in at}
        return MaterialPoints(deformation.tool.body.nodes, at, cells=cells) if at else None

    def row(self) -> dict[str, float]:
        """Columns of the points in tools: places in space, displacements and stresses. Collective."""
        row = {}
        for deformation in self.tools:
            if deformation.name in self._points:
                row |= tracked(deformation.field(), self._points[deformation.name], self.scene.axes,
                               deformation.known.motion)
        return row

    def write(self, *, step: int, time: float) -> None:
        """A frame of every tool where it is now, not yet deformed: its displacements are among the fields. Collective."""
        for deformation in self.tools:
            tool, motion = deformation.tool, deformation.known.motion
            contacts = getattr(tool.solver, "contacts", ())
            parts = tool.meshed.parts
            cells = {"body": parts.of_cell.astype(np.int32)} if len(parts.names) > 1 else None
            data = point_data(deformation.field(), contacts, motion.rotation() if motion.angle else None)
            self._writers[deformation.name].write(tool.body.nodes, step=step, time=time, point_data=data, cell_data=cells,
                                                  positions=motion.to_space(tool.body.nodes.x))

    def summary(self) -> dict:
        """Tool → part → its largest displacement and stress, and how much of it has flowed. Collective."""
        found = {}
        for deformation in self.tools:
            field, parts = deformation.field(), deformation.tool.meshed.parts
            found[deformation.name] = {part: part_numbers(field, parts, part) for part in parts.names}
        for numbers in (numbers for parts in found.values() for numbers in parts.values()):
            del numbers["extents_mm"]
        return found


def series_of(tool: str) -> str:
    """Name of the frames of a tool: ``tool_upper.pvd``, ``tool_upper_000012.vtu``."""
    return f"tool_{tool}"
