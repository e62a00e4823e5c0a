"""A tool brought under load: first put together, then loaded in steps that are cut where the tool cannot follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...physics.tool_body import ToolField, ToolSettings, fields
from ...physics.tool_body.memory import ToolMemory, memory_of, remember
from .bodies import MeshedTool


class LoadedTool:
    """A tool with its solver, and how far its loads are on.

    Parameters
    ----------
    tool : from `bodies.tool_body`
    settings : of the solver · numbers : further ones for that of an assembled tool

    Attributes
    ----------
    level : part of its loads that the tool carries · iterations : of the last call
    """

    def __init__(self, tool: MeshedTool, settings: ToolSettings = ToolSettings(), **numbers):
        self.tool, self.settings = tool, settings
        self.solver = tool.solver(settings, **numbers)
        self.level, self.iterations, self._assembled = 0.0, 0, 0.0
        if tool.contacts:
            self.solver.set_interference(0.0)

    @property
    def is_prestressed(self) -> bool:
        """Whether interference or displaced supports stress it before any load does."""
        return any(contact.interference for contact in self.tool.contacts) or self.tool.body.moves_supports

    @property
    def is_stepwise(self) -> bool:
        """Whether the way to the load matters: by yielding or by friction between parts."""
        return self.tool.body.yields or any(contact.friction.law != "none" for contact in self.tool.contacts)

    def assemble(self, part: float = 1.0) -> None:
        """Go to a part of the interference and of the displacements that supports are given, under the loads there are.
        Collective.

        Raises
        ------
        ConvergenceError
            if the tool is free to move, or does not bear it.
        """
        before, self.iterations = self._assembled, 0
        steps = self.settings.steps if self.is_stepwise and self.is_prestressed else 1
        for k in range(1, steps + 1):
            reached = before + (part - before) * k / steps
            if self.tool.contacts:
                self.solver.set_interference(reached)
            self.iterations += self.solver.solve(self._loads(self.level), held=reached, steps=1)
        self._assembled = part

    def load(self, level: float) -> None:
        """Go to ``level`` times the loads of the scene. Collective.

        Raises
        ------
        ConvergenceError
            if the tool cannot carry it; ``level`` is then what it carries.
        """
        before = self.level
        try:
            self.iterations = self.solver.solve(self._loads(level), steps=1)
        except Exception:
            self.level = before + self.solver.reached * (level - before)
            raise
        self.level = level

    def change_loads(self, loads) -> None:
        """Go from the loads there are to others, which take their place. Collective.

        Raises
        ------
        ConvergenceError
            if the tool cannot carry them; what it carries then lies between both.
        """
        self.tool = replace(self.tool, loads=tuple(loads))
        self.level = 1.0
        self.iterations = self.solver.solve(self._loads(1.0), steps=1)

    def memory(self) -> ToolMemory:
        """What a resumed run goes on from. Collective."""
        memory = memory_of(self.solver)
        memory.numbers |= {"level": self.level, "assembled": self._assembled}
        return memory

    def remember(self, memory: ToolMemory, loads=None) -> None:
        """Take over what :meth:`memory` gave, with the loads of then where they have changed. Collective."""
        self.level, self._assembled = memory.numbers["level"], memory.numbers["assembled"]
        if loads is not None:
            self.tool = replace(self.tool, loads=tuple(loads))
        remember(self.solver, memory)
        if self.tool.contacts:
            self.solver.set_interference(self._assembled)
            self.solver.go_back(self.solver.state())

    def field(self) -> ToolField:
        """Stresses and displacements of now. Collective."""
        return fields(self.solver, self.iterations)

    def _loads(self, level: float) -> list:
        return [replace(load, value=np.multiply(load.value, level)) for load in self.tool.loads] if level else []
