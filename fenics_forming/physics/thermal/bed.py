r"""The columns below the surface of a tool: they stand at the corners of a grid that is fixed to the tool.

A body that slides leaves warm columns behind and comes upon cold ones. A point X of the surface, in the frame of the tool,
stands on the columns at the corners of its cell with the shares of the multilinear hats of the grid: no description of the
surface is needed, whatever its shape is, and the same place is always the same mix of columns. A column belongs to that
much of the surface as has been touched, :math:`a_p=\int W_p\,dA`; where the contact spreads, its heat spreads with it.

In a step a column is a node of the network: its surface answers a steady flux q at once by the rise R(Δt) q / e, and by
:math:`T^*` goes where it would go without it,

.. math:: T_p = T_p^* + R\,q_p/e \quad\Longleftrightarrow\quad C_p\,(T_p-T_p^*) = a_p\,q_p\,\Delta t,
          \qquad C_p = a_p\,e\,\Delta t/R .
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from . import columns

SPACING = 0.5      # of the side of the surface that touches first
LEAST = 1e-3       # share of a column, below which a point does not stand on it


@dataclass(frozen=True)
class Bed:
    """The columns of one tool.

    spacing : of the grid, mm, 0 as long as nothing has touched · corners : (p, dim) whole numbers of the grid
    area : (p,) surface that has been touched, mm² (mm in plane strain) · modes : (p, m) of the columns, mJ/mm²
    """

    spacing: float
    corners: np.ndarray
    area: np.ndarray
    modes: np.ndarray

    @classmethod
    def untouched(cls, dim: int) -> Bed:
        """No column has been touched yet."""
        return cls(0.0, np.empty((0, dim), int), np.empty(0), columns.at_rest(0))

    def touched(self, places: np.ndarray, area: np.ndarray, side: float) -> tuple[Bed, np.ndarray, np.ndarray]:
        """The bed with the columns below points, and the columns (n, k) below each of them with their shares (n, k).

        Parameters
        ----------
        places : (n, dim) mm, in the frame of the tool · area : (n,) of the points · side : length of the sides of the body
            that they are on, mm
        """
        if not len(places):
            return self, np.empty((0, 1), int), np.empty((0, 1))
        spacing = self.spacing or SPACING * side
        corners, shares = _cell(places / spacing)
        known = np.concatenate([self.corners, corners[shares > 0]])
        found, first, number = np.unique(known, axis=0, return_index=True, return_inverse=True)
        number, old = number.ravel(), len(self.area)
        order = np.argsort(first, kind="stable")      # those that there were keep their numbers
        place = np.empty(len(order), int)
        place[order] = np.arange(len(order))
        below = np.zeros(shares.shape, int)
        below[shares > 0] = place[number[old:]]
        now = np.bincount(below.ravel(), (shares * area[:, None]).ravel(), len(found))
        before = np.append(self.area, np.zeros(len(found) - old))
        grown = np.maximum(now, before)
        modes = np.concatenate([self.modes, columns.at_rest(len(found) - old)]) * (before / grown)[:, None]
        return Bed(spacing, found[order], grown, modes), below, shares

    def capacity(self, effusivity: float, dt: float) -> np.ndarray:
        """C of the columns in a step, (p,) mJ/K."""
        return self.area * effusivity * dt / columns.resistance(dt)

    def rise(self, effusivity: float, dt: float) -> np.ndarray:
        """Rise of the surfaces (p,), K, after ``dt``, s, without flux."""
        return columns.rise(self.modes, dt) / effusivity

    def advanced(self, heat: np.ndarray, dt: float) -> Bed:
        """The bed after a step of ``dt``, s, in which its columns were given ``heat`` (p,), mJ."""
        return replace(self, modes=columns.advanced(self.modes, heat / (self.area * dt), dt))

    def memory(self) -> dict:
        """The bed, as JSON can hold it."""
        return {"spacing": self.spacing, "corners": self.corners.tolist(), "area": self.area.tolist(),
                "modes": self.modes.tolist()}

    @classmethod
    def remembered(cls, memory: dict, dim: int) -> Bed:
        """What :meth:`memory` gave."""
        if not memory["area"]:
            return cls.untouched(dim)
        return cls(memory["spacing"], *(np.array(memory[name]) for name in ("corners", "area", "modes")))


def _cell(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 2^dim, dim) of the cells of a grid of spacing 1 that points (n, dim) are in, and the hats there."""
    low = np.floor(places).astype(int)
    inside = places - low
    step = np.array(list(product((0, 1), repeat=places.shape[1])))
    hats = np.where(step == 1, inside[:, None, :], 1.0 - inside[:, None, :]).prod(axis=2)
    hats = np.where(hats < LEAST, 0.0, hats)
    return low[:, None, :] + step, hats / hats.sum(axis=1, keepdims=True)
