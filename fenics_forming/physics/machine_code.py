"""Compilation of kernels by numba."""

from __future__ import annotations

from numba import njit

# Sums may be reordered, as in the forms; infinities and NaN keep their meaning.
FAST = {"reassoc", "contract", "arcp", "nsz"}


def compiled(function):
    """Compile, with the machine code kept on disk where some folder for that is writable."""
    try:
        return njit(cache=True, fastmath=FAST)(function)
    except RuntimeError:        # numba found neither the source tree nor the user's cache folder writable
        return njit(fastmath=FAST)(function)
