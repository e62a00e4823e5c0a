r"""Motions of a tool that the velocity solve finds, beside those that its drive gives: press frames, free rolls, rams.

With the given velocity of the tool's surface :math:`V_q` and the unknown rates :math:`a`,

.. math:: v_t(x) = V_q(x) + \Phi(x)\,a ,\qquad M\dot a + K u = f - \int \Phi^T t\,d\Gamma ,\qquad \dot u = a ,

t the traction of the tool on the body.  The rates of a solve are means over its horizon :math:`\tau`, from the state
:math:`u_0, w_0` that was last settled: :math:`(2M/\tau)(a-w_0)+K(u_0+\theta\tau a)=f-Q`, :math:`Q=\int\Phi^Tt`.  With a
mass :math:`\theta=1/2` keeps energy.  Without, u follows the force; :math:`\theta=1` takes it there in one step, but with
the force on the geometry of the solve, not on that at the end of the horizon.  So where the force goes on smoothly the Q at
the end is extrapolated from the unknown one of this solve and an earlier one, :math:`Q_e=Q+r(Q-Q_p)`: second order, and
no ringing at any step.  (With the Q's of two earlier solves it would ring as the lagged scheme of
``process.tools.stability`` does; the rule :math:`\theta=1/2` would ring as well, since nothing of :math:`u_0` is left
in :math:`u_1`.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

SMOOTH = 0.2     # relative change of the reaction since the settled state, up to which it is extrapolated


class FreeMotions:
    """State and resistance of n unknown motions of one tool; the shapes of the motions are those of a subclass.

    Parameters
    ----------
    count : n · stiffness : (n, n), (n,) or number, N/mm (N mm of a rotation) · mass : (n,) or number, t (t mm²)

    Attributes
    ----------
    rate : (n,) mm/s or rad/s, found by the solve and the start of the next · force : (n,) N or N mm, given
    displacement, velocity : (n,) at the time ``since``, s · horizon : of the last solve, s · now : its time, s
    reaction : (n,) N, Q of the solve at ``since``, to extrapolate from; None where it does not go on smoothly
    speed : mm/s, of the tools in the next solve
    given : whether the rates are given, and no unknowns of the solve · earlier : (n,) displacement when they were found
    pace : (n,) mean rates of the last tool step
    basis : (points · dim, n) the motions at the contact points
    resistance, load : (n, n) and (n,) of the next solve: resistance · rate = load - reaction of the body
    """

    share_of_drive = 1.0     # of the drive's own velocity, that the tool counts to have at least
    deforms = False     # whether they are those of a surface, of which a point meets but a few

    def __init__(self, count: int, *, stiffness=0.0, mass=0.0, force=0.0, velocity=0.0):
        stiffness = np.asarray(stiffness, float)
        self.stiffness = stiffness if stiffness.ndim == 2 else np.diag(np.broadcast_to(stiffness, count))
        self.mass, self.force = (np.broadcast_to(np.asarray(a, float), count).copy() for a in (mass, force))
        self.velocity = np.broadcast_to(np.asarray(velocity, float), count).copy()
        self.displacement, self.rate = np.zeros(count), self.velocity.copy()
        self.since, self.now, self.horizon, self.count = 0.0, 0.0, 1.0, count
        self.reaction: np.ndarray | None = None
        self.speed = 0.0
        self._begun: np.ndarray | None = None      # rates at the start of the step, which count half of it
        self._start: tuple[float, np.ndarray, float] | None = None      # time, Q and speed of the last solve at a start
        self._goes_on = False           # whether Q goes on smoothly from there
        self._set_out: np.ndarray | None = None    # where the drive had the tool at ``since``
        self._gone: tuple[float, float] | None = None   # its way since then, mm, and its speed now
        self._implicit = 0.5 if self.mass.any() else 1.0
        self.basis, self.given, self.earlier, self.pace = None, False, np.zeros(count), np.zeros(count)

    # ------------------------------------------------------------------ in time
    def goes(self, motion, time: float) -> None:
        """The drive has its tool there at a time, and so fast."""
        self.now, self._gone = time, None
        if self._set_out is None or time <= self.since:
            self._set_out = motion.displacement
        else:
            self._gone = tuple(float(np.linalg.norm(v)) for v in (motion.displacement - self._set_out, motion.velocity))

    def at(self, time: float) -> np.ndarray:
        """Displacements with the present rates at a time, (n,); before ``since`` those of then."""
        rate = self.rate if self._begun is None else 0.5 * (self._begun + self.rate)
        return self.displacement + max(time - self.since, 0.0) * rate

    def average(self) -> None:
        """In this step the body moves by the mean of its velocities at both ends: so does what neither stiffness nor mass
        ties to the end of the step, whose rates are those of an instant."""
        if not self.stiffness.any() and not self.mass.any():
            self._begun = self.rate.copy()

    def settle(self, time: float) -> None:
        """What the rates have made of the state at ``time`` is what the next solves start from."""
        self.displacement = self.at(time)
        with_mass = self.mass > 0
        self.velocity = np.where(with_mass, self.velocity + 2 * (time - self.since) / self.horizon *
                                 (self.rate - self.velocity), self.rate)
        self.since, self.reaction, self._set_out, self._begun = time, None, None, None

    def prepare(self, horizon: float) -> None:
        """Resistance and load of a solve whose rates hold for ``horizon``, s, from the settled state on."""
        self.horizon, inertia = horizon, 2 * self.mass / horizon
        self.resistance = self._implicit * horizon * self.stiffness + np.diag(inertia)
        self.load = self.force - self.stiffness @ self.displacement + inertia * self.velocity
        earlier, more = self._before_now()
        if earlier is not None:
            self.resistance = self.resistance / (1.0 + more)
            self.load = (self.load + more * earlier) / (1.0 + more)

    def follow(self, ratio: float) -> None:
        """The tools have become this many times as fast: what yields to them, without mass, starts the next solve so."""
        if not self.mass.any():
            self.rate = ratio * self.rate

    def _before_now(self) -> tuple[np.ndarray | None, float]:
        """An earlier reaction Q_p (n,), N, to extrapolate from, and r: the way of the tools to the end of the horizon over
        that since then. In the middle of a step Q_p is that of its start, at a start that of the start before."""
        passed = self.now - self.since
        if passed > 1e-9 * self.horizon:
            whole = self.horizon / passed
            if self._gone is not None and self._gone[0] > 0:
                # nodes go on with the velocity in the middle: of a crank that comes to rest that is 4/3 of the way so far
                whole = min(max(self._gone[1] * self.horizon / self._gone[0], 1.0), whole)
            return (self.reaction, whole - 1.0) if passed < (1 - 1e-9) * self.horizon else (None, 0.0)
        if not self._goes_on:
            return None, 0.0
        time, reaction, speed = self._start
        way = 0.5 * (speed + self.speed) * (self.now - time)
        to_come = self.speed * self.horizon
        return (reaction, min(to_come / way, 1.0)) if way > 0 else (None, 0.0)

    def forget(self) -> None:
        """The reaction does not go on from what it was."""
        self.reaction, self._start, self._goes_on = None, None, False

    def found(self, reaction: np.ndarray) -> bool:
        """A solve has converged with this reaction of the body, Q (n,), N; whether it has to be done again, because the
        motions resist otherwise than they were prepared to."""
        if self.now > self.since or self.mass.any():
            return False
        change = self.stiffness @ (self.rate * self.horizon)
        self._keep(reaction, smooth=np.linalg.norm(change) <= SMOOTH * np.linalg.norm(reaction))
        return False

    def _keep(self, reaction: np.ndarray, smooth: bool) -> None:
        """The reaction at the start of a step."""
        before, self._start = self._start, (self.now, reaction.copy(), self.speed)
        self.reaction = self._start[1] if smooth else None
        self._goes_on = bool(smooth and self.stiffness.any() and before is not None and self.now > before[0])

    @property
    def time_left(self) -> float:
        """Time, s, over which the body changes its shape before a given force has to be met; 0 where that is at once."""
        return 0.0

    def power(self, forces: np.ndarray) -> float:
        """Sizes of the powers of forces (n,) N on the present motions, summed, mW."""
        return float(np.abs(forces * self.rate).sum())

    def unopposed(self) -> np.ndarray:
        """Rates over the prepared horizon where no body opposes them, (n,); the present ones of what nothing resists."""
        return self.rate + np.linalg.pinv(self.resistance) @ (self.load - self.resistance @ self.rate)

    def under(self, reaction: np.ndarray) -> np.ndarray:
        """Displacements under a lasting reaction of the body, Q (n,) N, with the present stiffness: (n,)."""
        return np.linalg.solve(self.stiffness, self.force - reaction)

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) of the motions in an order that stays when others become unknown."""
        return values

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """The values (n,) of the motions of what :meth:`spread` gave."""
        return values

    def velocities(self, rate: np.ndarray | None = None) -> np.ndarray:
        """Of the tool's surface by these motions at the contact points, (points, dim), mm/s."""
        dim = self._dim
        return np.asarray(self.basis @ (self.rate if rate is None else rate)).reshape(-1, dim)

    def reached(self) -> np.ndarray:
        """Which motions the contact points may meet before the pairing is found anew, (points · dim, n)."""
        return np.ones(self.basis.shape)

    # ------------------------------------------------------------------ going back
    def memory(self) -> dict[str, np.ndarray | float]:
        """The state, to give back to :meth:`remember` or to write to a checkpoint."""
        return {"displacement": self.displacement.copy(), "velocity": self.velocity.copy(), "rate": self.rate.copy(),
                "force": self.force.copy(), "since": self.since, "now": self.now, "horizon": self.horizon,
                "reaction": self.reaction, "given": self.given, "earlier": self.earlier.copy(),
                "pace": self.pace.copy(), "goes_on": self._goes_on,
                "start": None if self._start is None else [self._start[0], self._start[1].tolist(), self._start[2]]}

    def remember(self, memory) -> None:
        """Take over what :meth:`memory` gave."""
        self.given, self._set_out, self._begun = bool(memory["given"]), None, None
        for name in ("displacement", "velocity", "rate", "force", "earlier", "pace"):
            setattr(self, name, np.array(memory[name], float))
        self.since, self.now, self.horizon = (float(memory[name]) for name in ("since", "now", "horizon"))
        self.reaction = None if memory["reaction"] is None else np.array(memory["reaction"], float)
        self._goes_on, start = bool(memory["goes_on"]), memory["start"]
        self._start = None if start is None else (start[0], np.array(start[1], float), start[2])


class RigidMotions(FreeMotions):
    """Unknown translations of a rigid tool, and its rotation about the centre of its drive.

    Parameters
    ----------
    directions : (k, dim) unit vectors of the translations · rotates : whether the rotation is the last unknown
    stiffness, mass, force, velocity : see `FreeMotions`; as far as the modelled part of the bodies counts: of a quarter
        model a quarter of the stiffness of the press
    """

    def __init__(self, directions, *, rotates: bool = False, **resistance):
        self.directions = np.atleast_2d(np.asarray(directions, float))
        self._dim, self.rotates = self.directions.shape[1], rotates
        super().__init__(len(self.directions) + rotates, **resistance)

    @classmethod
    def rotation(cls, dim: int, **resistance) -> RigidMotions:
        """A tool that turns freely and does nothing else by itself."""
        return cls(np.empty((0, dim)), rotates=True, **resistance)

    def moved(self, motion, time: float):
        """The motion of the drive with the displacements of these motions at a time added to its placement."""
        self.goes(motion, time)
        u, k = self.at(time), len(self.directions)
        return replace(motion, displacement=motion.displacement + u[:k] @ self.directions,
                       angle=motion.angle + (u[k] if self.rotates else 0.0))

    def search(self, points: np.ndarray, motion, gap=None, normal=None) -> None:
        """The motions at points in space, (points, dim), with the tool where it is, at whatever gap."""
        columns = [np.broadcast_to(d, points.shape) for d in self.directions]
        if self.rotates:
            columns.append(motion.spin_at(points))
        self.basis = np.stack(columns, axis=-1).reshape(-1, self.count)
