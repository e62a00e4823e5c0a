r"""One implicit step of heat between nodes that store heat and pairs of nodes that conduct it.

Conduction with lumped capacities, exchange with tools and air, and exchange between two meshes all have this form:

.. math:: C_i\,(T_i-T_i^0) = Q_i + \Delta t\Big[\sum_j g_{ij}(T_j-T_i) + \sum_k b_{ki}(A_{ki}-T_i)
          - r_i\big(\hat T_i^4-\hat A_i^4\big)\Big]

(backward Euler; hats: kelvin). What a node gives, its partner takes: heat is conserved to rounding. Where all
:math:`g\ge0`, no node becomes hotter than the hottest, or colder than the coldest, of its own past (with the heat it was
given), its partners and its surroundings, however long the step. Obtuse cells have pairs with :math:`g<0`; they are left
out only where the solution shows that they do harm (:meth:`Network.step`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from ...laws.heat_exchange import STEFAN_BOLTZMANN, ZERO_CELSIUS

MOST_DIRECT = 20_000    # nodes; beyond, conjugate gradients
HELD = 1e-3             # of the heat that nodes hold: where less is moved, an imbalance is relative to this
SETTLED = 1e-11         # of the range of the temperatures: when the iterations have ended
SLACK = 1e-9            # of the same: what counts as an overshoot


@dataclass(frozen=True)
class Surroundings:
    """What nodes exchange heat with: conductance (n,) mW/K to something of the temperature ambient (n,) or one, degC."""

    conductance: np.ndarray
    ambient: np.ndarray | float


@dataclass(frozen=True)
class Radiation:
    """Grey surroundings: area times emissivity (n,) mm², and their temperature (n,) or one, degC."""

    area: np.ndarray
    ambient: np.ndarray | float

    def power(self, temperature: np.ndarray) -> np.ndarray:
        """Lost by the nodes, mW."""
        return STEFAN_BOLTZMANN * self.area * ((temperature + ZERO_CELSIUS) ** 4 - (self.ambient + ZERO_CELSIUS) ** 4)

    def slope(self, temperature: np.ndarray) -> np.ndarray:
        """Derivative of the power, mW/K."""
        return 4 * STEFAN_BOLTZMANN * self.area * (temperature + ZERO_CELSIUS) ** 3


@dataclass(frozen=True)
class Stepped:
    """What a step found: temperatures (n,) degC, heat lost to each of the surroundings (n,) mJ by name, the heat that is
    not accounted for relative to what was moved, and how many pairs were left out."""

    temperature: np.ndarray
    lost: dict[str, np.ndarray]
    imbalance: float
    cut_pairs: int


@dataclass
class Network:
    """Nodes, pairs and surroundings.

    Parameters
    ----------
    capacity : (n,) mJ/K · pairs : (m, 2) · conductance : (m,) mW/K · surroundings, radiation : by name
    """

    capacity: np.ndarray
    pairs: np.ndarray
    conductance: np.ndarray
    surroundings: dict[str, Surroundings] = field(default_factory=dict)
    radiation: dict[str, Radiation] = field(default_factory=dict)

    def step(self, temperature: np.ndarray, heat: np.ndarray, dt: float) -> Stepped:
        """Temperatures after ``dt``, s, in which the nodes are given ``heat`` (n,), mJ.

        Pairs with a negative conductance are kept as long as no node overshoots; those of a node that does are cut, which
        is a little more conduction there and none elsewhere, and the step is done again.
        """
        g, cut = self.conductance, np.zeros(len(self.pairs), bool)
        while True:
            found = self._solve(temperature, heat, dt, np.where(cut, 0.0, g))
            harmful = ~cut & (g < 0)
            if harmful.any():
                over = self._overshoots(temperature + heat / self.capacity, found, np.where(cut, 0.0, g))
                harmful &= over[self.pairs].any(axis=1)
            if not harmful.any():
                return self._balanced(temperature, heat, dt, found, int(cut.sum()))
            cut |= harmful

    # ------------------------------------------------------------------ the equations
    def _solve(self, start, heat, dt, g):
        i, j = self.pairs.T
        n = len(start)
        storing = self.capacity / dt
        diagonal = storing + np.bincount(i, g, n) + np.bincount(j, g, n)
        for outside in self.surroundings.values():
            diagonal = diagonal + outside.conductance
        rows = np.concatenate([i, j, np.arange(n)])
        columns = np.concatenate([j, i, np.arange(n)])

        now = start + heat / self.capacity
        scale = self._range(now)
        solve = None
        for _ in range(50):
            sloped = diagonal + sum(r.slope(now) for r in self.radiation.values())
            if solve is None or self.radiation:
                matrix = sparse.csc_matrix((np.concatenate([-g, -g, sloped]), (rows, columns)), (n, n))
                solve = _solver(matrix)
            change = solve(self._gains(now, g) + heat / dt - storing * (now - start))
            now = now + change
            if np.abs(change).max(initial=0.0) <= SETTLED * scale:
                break
        return now

    def _gains(self, temperature, g):
        """Power that the nodes gain by conduction and exchange, mW."""
        i, j = self.pairs.T
        flow = g * (temperature[j] - temperature[i])
        n = len(temperature)
        gains = np.bincount(i, flow, n) - np.bincount(j, flow, n)
        for outside in self.surroundings.values():
            gains += outside.conductance * (outside.ambient - temperature)
        for radiation in self.radiation.values():
            gains -= radiation.power(temperature)
        return gains

    # ------------------------------------------------------------------ bounds
    def _range(self, temperature):
        low, high = self._bounds(temperature)
        return max(float(high.max(initial=0.0) - low.min(initial=0.0)), 1.0)

    def _bounds(self, by_itself):
        """Lowest and highest temperature that a node has had, or is drawn to from outside, (n,) twice."""
        low, high = by_itself.copy(), by_itself.copy()
        drawn = [(s.conductance, s.ambient) for s in self.surroundings.values()]
        drawn += [(r.area, r.ambient) for r in self.radiation.values()]
        for strength, ambient in drawn:
            on = strength > 0
            low = np.where(on, np.minimum(low, ambient), low)
            high = np.where(on, np.maximum(high, ambient), high)
        return low, high

    def _overshoots(self, by_itself, found, g):
        """Nodes (n,) that are outside the range of what can have drawn them there."""
        low, high = self._bounds(by_itself)
        i, j = self.pairs[g != 0].T
        np.minimum.at(low, i, found[j])
        np.minimum.at(low, j, found[i])
        np.maximum.at(high, i, found[j])
        np.maximum.at(high, j, found[i])
        slack = SLACK * self._range(by_itself)
        return (found < low - slack) | (found > high + slack)

    # ------------------------------------------------------------------ the balance
    def _balanced(self, start, heat, dt, found, cut):
        lost = {name: dt * s.conductance * (found - s.ambient) for name, s in self.surroundings.items()}
        lost |= {name: dt * r.power(found) for name, r in self.radiation.items()}
        stored = float(self.capacity @ (found - start))
        terms = [stored, float(heat.sum()), *(float(loss.sum()) for loss in lost.values())]
        open_ = stored - float(heat.sum()) + sum(float(loss.sum()) for loss in lost.values())
        # rounding is relative to the heat that the nodes hold; a body that keeps its temperature moves none
        moved = max(sum(map(abs, terms)), HELD * float(self.capacity @ np.abs(found)), 1e-300)
        return Stepped(found, lost, open_ / moved, cut)


def _solver(matrix):
    """b (n,) → x (n,) for a symmetric positive matrix."""
    if matrix.shape[0] <= MOST_DIRECT:
        return linalg.splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve
    matrix = matrix.tocsr()
    inverse = sparse.diags(1.0 / matrix.diagonal())

    def solve(b):
        x, failed = linalg.cg(matrix, b, rtol=1e-12, atol=0.0, M=inverse, maxiter=5000)
        if failed:
            raise ArithmeticError("the heat equations did not converge")
        return x

    return solve
