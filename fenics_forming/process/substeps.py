"""Sub-steps: the material is carried several times within a step through the velocity field of its start."""

from __future__ import annotations

import numpy as np

from . import shifting
from .integration import Body, Flow, Scheme, StepEnd, advanced

ON_BOARD = 1e-9     # of the body's size: a place that is not farther outside the mesh is on its boundary


class Substeps(Scheme):
    r"""``count`` sub-steps h = dt/count through the frozen field of the start, one solve a step.

    "plain": :math:`x_{s+1}=x_s+h\,v(x_s)`; along a steady stream line the error of the explicit shift divided by the
    count; first order. "midpoint": :math:`x_{s+1}=x_s+h\,v(x_s+\tfrac h2v(x_s))+h^2(s+\tfrac12)\,v_t` with
    :math:`v_t=(v(x_{old})-v_{old}(x_{old}))/\Delta t_{old}`, the present field at the places of the step before, which is
    nothing in steady flow (and left out in the first step); second order.

    With ``rotation`` every sub-step turns by the local spin. The history is summed along the path. Nodes in contact
    follow their tools after every sub-step.

    What is remembered (:meth:`memory`) are smooth nodal fields, also the positions: interpolated to the nodes of a new
    mesh they serve on.
    """

    name = "substeps"
    look_ahead = 1.0

    def __init__(self, count: int = 3, rule: str = "plain", rotation: bool = False):
        super().__init__(rotation)
        self.count, self.rule = count, rule
        self._last: dict[str, np.ndarray] = {}
        self._last_dt = np.inf

    @classmethod
    def of(cls, choice) -> Substeps:
        return cls(choice.substeps, choice.rule, choice.rotation)

    def memory(self):
        return ({"dt": self._last_dt}, dict(self._last)) if self._last else ({}, {})

    def remember(self, numbers, nodal):
        if nodal:
            self._last, self._last_dt = dict(nodal), numbers["dt"]

    def advance(self, body: Body, start: Flow, time: float, history: dict, dt: float) -> StepEnd:
        start = body.pace(time, time, dt).of(start)
        h, x0 = dt / self.count, body.x.copy()
        values, by_midpoint = self._values(body, start), self.rule == "midpoint"
        field = body.frozen(values)
        known = x0.shape[1] + len(start.rates)
        change = self._change(body, start, field) if by_midpoint and self._last else np.zeros((1, known))
        slack = 0.5 * dt**2 * np.linalg.norm(change[:, : x0.shape[1]], axis=1)     # it may overshoot
        parts = []
        for s in range(self.count):
            x = body.x.copy()
            here = values if s == 0 else field.at(x)
            if by_midpoint:
                here = field.at(x + 0.5 * h * self._mean(here, x.shape[1], 0.5 * h, "start"))
                here[:, :known] += (s + 0.5) * h * change
            body.x[:] = x + h * self._mean(here, x.shape[1], h, "middle" if by_midpoint else "start")
            body.place(time + body.lapse(time, dt, (s + 1) / self.count), slack)
            parts.append((h, dict(zip(start.rates, here[:, x.shape[1]:].T, strict=False))))
        if by_midpoint:
            rates = {f"rate.{name}": rate for name, rate in start.rates.items()}
            self._last, self._last_dt = {"positions": x0, "velocity": start.velocity, **rates}, dt
        return StepEnd(advanced(history, *parts), 0, 0, None, np.inf)

    def _values(self, body, start):
        """Velocity, rates and, for rotation, the velocity gradient at the nodes, side by side (n, k)."""
        gradient = [body.velocity_gradient().reshape(len(body.x), -1)] if self.rotation else []
        return np.column_stack([start.velocity, *start.rates.values(), *gradient])

    def _mean(self, values, dim, h, known_at):
        """Velocity that carries a node through a sub-step."""
        if not self.rotation:
            return values[:, :dim]
        gradient = values[:, -dim * dim:].reshape(-1, dim, dim)
        return shifting.turned(values[:, :dim], gradient, h, known_at=known_at)

    def _change(self, body, start, field):
        """Change per second of velocity and rates at a fixed place, (n, k).

        Where that place now lies outside the body (a tool has come), the recovered gradient leads there: that of the
        one cell at a singular corner would not do, nodes would run away.
        """
        old = self._last["positions"]
        before = np.column_stack([self._last["velocity"], *(self._last[f"rate.{name}"] for name in start.rates)])
        found = field.find(old)
        now = field.at(old, found)[:, : before.shape[1]]
        off = found.distance > ON_BOARD * np.ptp(old, axis=0).max()
        back = np.einsum("nij,nj->ni", body.velocity_gradient()[off], (old - body.x)[off])
        now[off] = np.column_stack([start.velocity[off] + back, *(rate[off] for rate in start.rates.values())])
        return (now - before) / self._last_dt
