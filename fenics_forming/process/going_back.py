"""What a flowing body gives back after a failed step, and takes over from the one whose mesh it replaces."""

from __future__ import annotations


class GoingBack:
    """How a `FlowingBody` goes back, and goes on; mixed into it."""

    def snapshot(self) -> tuple:
        """Everything that a failed step must give back."""
        motions = [(t.motion, t.traction, _state_of(t)) for t in self.tools]
        states = [[a.copy() for a in vars(state).values()] for state in self._states]
        w = self.workpiece
        moving = None if self.inertia is None else self.inertia.snapshot()
        return (self.x.copy(), w.solution.x.array.copy(), w.tau.copy(), w.is_cold, w.last_rate, motions, states, moving,
                self.rams.memory(), self.solved_speed)

    def restore(self, snapshot: tuple) -> None:
        x, solution, tau, cold, last_rate, motions, states, moving, rams, self.solved_speed = snapshot
        self.rams.remember(rams)
        w = self.workpiece
        if self.inertia is not None:
            self.inertia.restore(moving)
        self.x[:] = x
        w.solution.x.array[:], w.tau[:], w.is_cold, w.last_rate = solution, tau, cold, last_rate
        for tool, (motion, traction, free) in zip(self.tools, motions, strict=True):
            tool.motion, tool.traction = motion, traction
            if tool.deformation is not None:
                tool.deformation.restore(self, free)
            elif free is not None:
                tool.free.remember(free)
        for state, arrays in zip(self._states, states, strict=True):
            for name, value in zip(vars(state), arrays, strict=True):
                setattr(state, name, value.copy())

    def continues(self, other) -> None:
        """Go on as ``other`` did, whose mesh this body's replaces: speed of the tools, penalty, clocks."""
        self.speed, self.size, self.solved_speed = other.speed, other.size, other.solved_speed
        self.seconds, self.solver.seconds = other.seconds, other.solver.seconds
        self.solver.system.counts.update(other.solver.system.counts)
        if self.contact is not None:
            self.contact.reference = other.contact.reference

    @property
    def _states(self) -> list:
        """The states of all contact points, of tools and of pairs of bodies."""
        between = [] if self.interfaces is None else [contact.state for contact in self.interfaces.contacts]
        return [tool.state for tool in self.tools] + between


def _state_of(tool):
    """What a tool that moves or deforms by itself must give back; None of others."""
    if tool.deformation is not None:
        return tool.deformation.snapshot()
    return None if tool.free is None else tool.free.memory()
