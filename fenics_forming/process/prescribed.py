"""A body that flows as it is told: for the study of the time schemes on any mesh, without a solve."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..physics.kinematics import KINDS, Kinematics
from ..physics.nodes import Nodes
from .frozen import FrozenField
from .integration import Flow, Scheme
from .pace import Pace


class PrescribedFlow:
    """A body in a known velocity field; implements ``integration.Body``.

    Parameters
    ----------
    nodes : the mesh by its nodes; it is moved
    velocity : f(x (n, dim) mm, time s) → (n, dim) mm/s
    kinematics : geometry kind or its name, "plane_strain" or "3d" if not given
    follow : f(x, time) that puts nodes onto their tools, in place; None: no tools
    """

    def __init__(self, nodes: Nodes, velocity: Callable, *, kinematics: Kinematics | str | None = None,
                 follow: Callable | None = None):
        self.nodes, self._field, self._follow = nodes, velocity, follow
        kind = kinematics or ("plane_strain" if nodes.dim == 2 else "3d")
        self.kinematics = KINDS[kind] if isinstance(kind, str) else kind
        self._velocity = np.zeros_like(self.x)

    @property
    def x(self) -> np.ndarray:
        return self.nodes.x

    def solve(self, time: float, history: dict[str, np.ndarray], dt: float, *, ahead: float = 1.0, gaps=None) -> Flow:
        """The given field at ``time`` on the present positions."""
        self._velocity = np.array(self._field(self.x, time), float)
        D = self.kinematics.strain_rate_at(self.velocity_gradient(), self._velocity, self.x)
        rate = self.nodes.with_mids(np.sqrt(2 / 3 * np.einsum("ni,ni->n", D, D)))
        return Flow(self._velocity, {"effective_strain": rate}, 0)

    def gaps(self) -> dict[str, np.ndarray]:
        return {}

    def place(self, time: float, slack: np.ndarray | float = 0.0) -> None:
        if self._follow is not None:
            self._follow(self.x, time)

    def average(self) -> None:
        """Its tools go where they are told to."""

    def pace(self, at: float, time: float, dt: float) -> Pace:
        """Its field knows of its own how fast it is at any time."""
        return Pace()

    def lapse(self, time: float, dt: float, share: float) -> float:
        return share * dt

    def comes_to_rest(self, time: float, dt: float) -> bool:
        return False

    def velocity_gradient(self) -> np.ndarray:
        return self.nodes.gradient(self._velocity)

    def turn(self, before: np.ndarray) -> None:
        """A given field is not sought: it starts from nothing."""

    def frozen(self, values: np.ndarray) -> FrozenField:
        return FrozenField(self.nodes, values)

    def new_history(self) -> dict[str, np.ndarray]:
        """What gathers in the material, by name and node: nothing yet."""
        return {"effective_strain": np.zeros(self.nodes.count)}


def carry(body: PrescribedFlow, scheme: Scheme, end: float, steps: int, *, after: Callable | None = None
          ) -> dict[str, np.ndarray]:
    """Move a body from time 0 to ``end`` in equal steps; the history of its nodes.

    ``after(time)`` is called after every step.
    """
    history, dt = body.new_history(), end / steps
    for k in range(steps):
        flow = body.solve(k * dt, history, dt)
        history = scheme.advance(body, flow, k * dt, history, dt).history
        if after is not None:
            after((k + 1) * dt)
    return history
