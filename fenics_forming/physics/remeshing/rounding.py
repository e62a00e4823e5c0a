"""What an engine is given, rounded: round-off, as between numbers of ranks, must not decide between equal choices."""

from __future__ import annotations

import numpy as np

DIGITS = 30      # binary ones of the extent of a body: positions on a grid of 1e-9 of it
ODD = 0.7368     # the grid gets coarser at powers of two over this, which no extent, mostly a round number, is near


def on_a_grid(x: np.ndarray) -> np.ndarray:
    """Positions (n, dim), mm, to 1e-9 of their extent."""
    step = 2.0 ** (np.ceil(np.log2(ODD * np.ptp(x, axis=0).max())) - DIGITS)
    return np.round(x / step) * step


def to_seven_digits(sizes: np.ndarray) -> np.ndarray:
    """Wanted sizes, mm, as exact as single precision is."""
    return np.asarray(sizes).astype(np.float32).astype(float)
