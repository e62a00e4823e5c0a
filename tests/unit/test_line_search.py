"""The share of an increment: whole where the flow resists it, else where the power of the residual on it vanishes."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_forming.physics.line_search import MOST, SETTLED, share_of


def counted(power):
    asked = []
    return (lambda share: asked.append(share) or power(share)), asked


def test_an_increment_to_where_the_power_vanishes_is_taken_whole_after_two_looks():
    power, asked = counted(lambda share: share - 1.0)
    assert share_of(power) == 1.0
    assert asked == [0.0, 1.0]


@pytest.mark.parametrize("turns", [0.3, 0.05, 0.005])
def test_a_strip_that_friction_alone_drives_goes_as_far_as_friction_turns_round(turns):
    """Friction of constant size and regularised sign, beside a resistance far too small to stop the strip, and a wall."""
    power, asked = counted(lambda s: np.tanh((s - turns) / (0.02 * turns)) + 1e-3 * s + 1e4 * max(s - 0.5, 0.0))
    share = share_of(power)
    assert abs(power(share)) < SETTLED * abs(power(0.0))
    assert share == pytest.approx(turns, rel=0.05)
    assert len(asked) <= MOST + 4
