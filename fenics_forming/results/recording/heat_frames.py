"""Frames of the temperatures of tools that have a mesh for them: ``heat_<tool>.pvd`` beside the fields of the workpiece."""

from __future__ import annotations

from pathlib import Path

from .fields import FieldWriter


class ToolHeatFrames:
    """Writes where tools are and how hot.

    Parameters
    ----------
    tools : the ``KnownTool`` s of the run, of which only those with a temperature field count
    """

    def __init__(self, folder: Path, tools, comm, *, resume_after: int | None = None):
        self._tools = [tool for tool in tools if tool.heat is not None]
        self._writers = {tool.name: FieldWriter(folder, comm, resume_after=resume_after, series=f"heat_{tool.name}")
                         for tool in self._tools}

    def write(self, *, step: int, time: float, state) -> None:
        """Write a frame of every tool; ``state`` of the heat. Collective."""
        for tool in self._tools:
            self._writers[tool.name].write(tool.heat.nodes, step=step, time=time,
                                           positions=tool.motion.to_space(tool.heat.nodes.x),
                                           point_data={"temperature_degC": tool.heat.nodal(state.tools[tool.name])})
