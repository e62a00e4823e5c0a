"""Flat rolling against the slab theory of REFERENCES.md 12.1, and rolls that the strip turns."""

from __future__ import annotations

import numpy as np
import pytest

import fenics_forming as ff
from demos.flat_rolling import ENTRY, EXIT, RADIUS, Arc, rolling


@pytest.mark.parametrize(("friction", "force", "torque", "neutral"), [(0.1, 833.839, 5170.2, 1.2339),
                                                                      (0.2, 1027.731, 6330.6, 1.5098)])
def test_force_torque_and_neutral_point_are_those_of_the_slab_theory(friction, force, torque, neutral, tmp_path, verified):
    results = ff.simulate(rolling(friction, coarse=True), tmp_path)
    steady = slice(len(results.history) // 2, None)
    ours = [results.history.column(name)[steady].mean() for name in ("force_roll_N_per_mm", "torque_roll_Nmm")]
    verified("12.1", f"force, friction {friction:g}", ours[0], force, within=0.08, unit="N/mm")
    verified("12.1", f"torque, friction {friction:g}", ours[1], torque, within=0.08, unit="N")
    verified("12.1", f"neutral angle, friction {friction:g}", Arc.of(results).neutral, neutral, within=0.3, unit="deg",
             absolute=True)
    # the rolls alone give the power: torque times angular speed (1 rad/s) of both
    power = results.summary["ledger"]["power"]["last_mW"]
    assert 2 * power["tools"] == pytest.approx(results.history.column("torque_roll_Nmm")[-1], rel=1e-6)
    assert abs(results.history.column("force_starter_N_per_mm")[-1]) < 1e-9 * force


def test_a_free_roll_turns_with_the_strip_that_is_pushed_through_and_needs_no_torque():
    scene = rolling(0.1, coarse=True, torque=0.0)
    results = ff.simulate(scene)
    force, torque = (results.history.column(name) for name in ("force_roll_N_per_mm", "torque_roll_Nmm"))
    assert np.abs(torque).max() < 2e-3 * force.max() * RADIUS * 0.1, "the tolerance of forces in a solve"
    push = 0.6 * RADIUS         # mm/s at the entry; the strip leaves faster in the ratio of heights
    speed = results.history.column("speed_roll_rad_per_s") * RADIUS
    assert (speed > push).all() and (speed < push * ENTRY / EXIT).all()
    assert results.history.column("force_starter_N_per_mm")[-1] > 2 / np.sqrt(3) * 100 * np.log(ENTRY / EXIT) * EXIT / 2


def test_a_torque_on_a_free_roll_is_what_it_gives_to_the_strip():
    driven, braked = (ff.simulate(rolling(0.1, coarse=True, torque=t, steps={"time": 4e-3, "tool": "starter"})).history
                      for t in ("500 N", "-500 N"))
    np.testing.assert_allclose(driven.column("torque_roll_Nmm"), 500, rtol=5e-3)
    np.testing.assert_allclose(braked.column("torque_roll_Nmm"), -500, rtol=5e-3)
    # two rolls at 0.7 rad/s save 2 * 350 mW of the power that the starter gives at 60 mm/s to the whole strip
    saved = braked.column("force_starter_N_per_mm").mean() - driven.column("force_starter_N_per_mm").mean()
    speed = driven.column("speed_roll_rad_per_s").mean()
    assert saved * 0.6 * RADIUS == pytest.approx(1000 * speed, rel=0.1), "the strip flows a little otherwise"
