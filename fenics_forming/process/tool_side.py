"""The side of a flowing body that meets its tools: where they are, and nodes that are put onto them."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from ..physics.contact.rigid import ToolMotion
from .pace import Pace, come_to_rest, lapse, mean_pace
from .shifting import put_on_tools


class ToolSide:
    """What a `FlowingBody` does with its tools; mixed into it."""

    def move_tools(self, time: float) -> None:
        """Put every tool where its drive has it at ``time``."""
        for tool in self.tools:
            tool.motion = motion_of(self._drives.get(tool.name), time, self.nodes.dim)
            if tool.free is not None:
                tool.motion = tool.free.moved(tool.motion, time)

    def average(self) -> None:
        """In a step that begins the body moves by the mean of its velocities at both ends: tools that it moves as well."""
        for tool in self.tools:
            if tool.free is not None:
                tool.free.average()

    def settle(self, time: float) -> None:
        """A step has ended at ``time``: what tools have moved by themselves is where their next motions start."""
        self.rams.arrive(self.tools, time)
        for tool in self.tools:
            if tool.free is not None:
                tool.free.settle(time)
            if tool.deformation is not None:
                tool.deformation.settle()

    def pace(self, at: float, time: float, dt: float) -> Pace:
        """Of the tools in the step from ``time`` on, for a flow found ``at`` a time; where they alone drive it."""
        return mean_pace(self._drives, at, time, dt) if self._driven_by_tools else Pace()

    def lapse(self, time: float, dt: float, share: float) -> float:
        """How long the tools take for a share of their way in the step from ``time`` on; where they alone drive it."""
        return lapse(self._drives, time, dt, share) if self._driven_by_tools else share * dt

    def comes_to_rest(self, time: float, dt: float) -> bool:
        """Whether all tools, and so the body, rest at the end of the step from ``time`` on."""
        return self._driven_by_tools and come_to_rest(self._drives, time, dt)

    @property
    def _driven_by_tools(self) -> bool:
        """Whether motions that are known functions of time, and nothing else, make the body flow."""
        known = not self.rams.by_tool and all(tool.free is None for tool in self.tools)
        return bool(self.tools) and known and self.inertia is None and not self._flows_by_itself

    @property
    def deformations(self) -> list:
        """Of the tools that yield (``process.tool_deformation``)."""
        return [tool.deformation for tool in self.tools if tool.deformation is not None]

    def place(self, time: float, slack: np.ndarray | float = 0.0) -> None:
        """Move the tools to ``time`` and put boundary nodes that have sunk into one back onto it; nodes of mirror planes
        stay on them, whatever a recovered gradient made of their velocities.

        ``slack`` (nodes,), mm: how much farther than usual a pressed node may hover and still be drawn onto its tool.
        """
        start = perf_counter()
        self.move_tools(time)
        held = self._pressed_nodes()
        self.x[self._held] = self._held_at
        self._as_shifted = self.x[self.boundary]
        reach = self.reach + (slack if np.size(slack) == 1 else slack[self.boundary])
        self.sunk = put_on_tools(self.x, self.tools, self.boundary, held, reach) if self.tools else 0.0
        self.x[self._held] = self._held_at      # where a tool slopes on a mirror plane, its normal leads away from there
        self.seconds["shifting"] += perf_counter() - start

    def _pressed_nodes(self) -> dict[str, np.ndarray]:
        return self.contact.pressed_nodes() if self.tools and not self.workpiece.is_cold else {}

    def follow_tools(self, time: float, ahead: float) -> float:
        """Tools that are solved at the end of a step, at ``time``, have deformed: contact knows of it, and nodes that are
        pressed are put onto those that carry them. The change of volume, mm³. Collective."""
        carried = {}
        for tool in self.tools:
            if tool.deformation is not None and tool.deformation.carries_the_surface:
                on = self._pressed_nodes().get(tool.name, np.zeros(len(self.x), bool))[self.boundary]
                carried[tool.name] = self.boundary[on & (tool.gap(self.x[self.boundary])[0] <= self.reach)]
        stored = self.rams.stored(self.tools)
        changed = [t.name for t in self.tools if t.deformation is not None and t.deformation.end(self, time)]
        self.rams.rebook(self.tools, stored)
        if not changed:
            return 0.0
        self.move_tools(time)
        before = self.x.copy()
        for tool in self.tools:
            if tool.name in changed and tool.name in carried:
                every = {tool.name: np.ones(len(self.x), bool)}
                put_on_tools(self.x, [tool], carried[tool.name], every, np.inf)
        self.x[self._held] = self._held_at
        inside = np.ones(len(self.x), bool)
        inside[self.boundary] = False
        self.x[inside] += self.nodes.with_mids(self.x - before)[inside]      # mid-nodes half-way with their ends
        self.search(ahead)
        self.contact.slip_anew(self.workpiece.velocity)
        return self.free_surface.volume(self.x) - self.free_surface.volume(before) if self.free_surface else 0.0


def motion_of(drive, time: float, dim: int) -> ToolMotion:
    """Where a drive has its tool at ``time``."""
    if drive is None:
        return ToolMotion(np.zeros(dim), np.zeros(dim))
    centre = drive.rotation_centre
    axis = drive.rotation_axis
    return ToolMotion(np.asarray(drive.displacement(time), float), np.asarray(drive.velocity(time), float),
                      float(drive.angle(time)), float(drive.angular_velocity(time)),
                      None if centre is None else np.asarray(centre, float),
                      None if axis is None else np.asarray(axis, float))
