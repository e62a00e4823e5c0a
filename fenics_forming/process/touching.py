"""Where a flowing body touches its tools and other bodies, how fast they come, and whether they make it flow."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from ..physics.gravity import GRAVITY
from ..physics.parallel import highest
from .approach import NEAR, time_to_contact


class Touching:
    """What a `FlowingBody` knows of its contact; mixed into it."""

    def gaps(self) -> dict[str, np.ndarray]:
        """Tool or pair of bodies → (points,) the gaps of the last search at the contact points, mm."""
        of_tools = {tool.name: tool.state.gap for tool in self.tools}
        return of_tools if self.interfaces is None else of_tools | self.interfaces.gaps()

    def search(self, dt: float) -> None:
        """Closest points of the contact facets; ``dt`` is what contact looks ahead."""
        if self.contact is None:
            self.speed = self.speed if self.inertia is None else self.inertia.speed([], None, 0.0, dt)
            return
        start = perf_counter()
        self.contact.search(self.x, dt)
        if self.workpiece.is_cold:
            self.contact.let_go()
        speed = self.tool_speed()
        if self.inertia is not None:
            speed = self.inertia.speed(self.tools, self.contact.facets.trace, speed, dt)
        if speed > 0:
            self.speed = speed
        elif self.speed == 0.0 and self.workpiece.mass is not None:
            self.speed = GRAVITY * dt       # nothing moves yet but what falls
        self.contact.set_speed(self.speed)
        if self.interfaces is not None:
            self.interfaces.search(self.x, dt, self.speed)
        self.seconds["contact search"] += perf_counter() - start

    def tool_speed(self) -> float:
        """Greatest speed of a tool at the contact points, mm/s; of one that yields also that of its drive."""
        fastest = max((float(np.sqrt((v**2).sum(axis=1).max(initial=0.0))) for t in self.tools
                       for v in t.velocities()), default=0.0)
        return highest(self.nodes.comm, fastest)

    def is_pushed(self, dt: float) -> bool:
        """Whether something makes the body flow: a tool that touches it and closes in or turns, or, of a body that
        flows already, one that lands on it within ``dt``; or an interference between bodies that is still there.

        Otherwise rest is the solution: a tool that stands still, withdraws or slides along presses nothing.
        """
        if self.contact is None or self._flows_by_itself or self.inertia is not None and self.inertia.moves():
            return True
        touch, size = self.time_to_contact(dt), NEAR * self.size
        turns = any(t.motion.angular_velocity != 0 and (t.state.gap <= size).any() for t in self.tools)
        pushed = touch <= 1e-9 * dt if self.workpiece.is_cold else touch < dt
        loaded = self.contact.is_loaded(size, ahead=0.0 if self.workpiece.is_cold else dt)
        pushed = pushed or highest(self.nodes.comm, float(loaded)) > 0
        return pushed or highest(self.nodes.comm, float(turns)) > 0 or \
            self.interfaces is not None and self.interfaces.interferes(size)

    def time_to_contact(self, horizon: float) -> float:
        """Time until the first tool touches the body, s; 0 where one touches already. Collective."""
        return time_to_contact(self, horizon)

    def between(self) -> dict[str, tuple] | None:
        """Pair of bodies → the points of their contact, and what the next solve starts from there, (points, k)."""
        if self.interfaces is None:
            return None
        memory = self.interfaces.memory()
        return {name: (contact.points, {"state": memory[name]}) for name, contact in self.interfaces.by_name.items()}

    def making(self) -> dict | None:
        """How several bodies share the mesh: cells of each, and which of two in contact holds the points."""
        if self.parts is None:
            return None
        return {"cells": self.parts.counts, "slaves": {} if self.interfaces is None else self.interfaces.slaves}
