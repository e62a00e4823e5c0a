"""The ram of a crank press is a slider-crank, to all digits of REFERENCES.md 11. No mesh."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fenics_forming import laws

CRANK = laws.CrankPressDrive(radius=100, rod=600, speed="60 rpm", direction=[0, -1])
PRINTED = 1e-6       # of six decimals


@pytest.mark.parametrize(("degrees", "height", "speed"), [
    (90, 108.392022, 628.318531), (60, 56.282896, 589.964648), (45, 33.470557, 497.015614),
    (30, 15.484422, 359.662522), (15, 3.965905, 188.825132), (5, 0.443835, 63.854725)])
def test_height_and_speed_before_the_dead_centre(degrees, height, speed, verified):
    time = CRANK.dead_centre_time - math.radians(degrees) / CRANK.speed
    where = f"{degrees} degrees before the dead centre"
    verified("11", f"crank, {where}: height", 200 - CRANK.travel(time), height, within=PRINTED, unit="mm", absolute=True)
    verified("11", f"crank, {where}: speed", -CRANK.velocity(time)[1], speed, within=PRINTED, unit="mm/s")
    assert CRANK.angle_at(CRANK.height_at(math.radians(degrees))) == pytest.approx(math.radians(degrees), rel=1e-12)


@pytest.mark.parametrize(("height", "degrees", "speed", "time"), [(20, 34.26213, 402.6713, 0.095173),
                                                                  (50, 56.10364, 570.4810, None)])
def test_started_above_the_dead_centre_it_takes_the_known_time(height, degrees, speed, time, verified):
    started = CRANK.replaced(dead_centre=height)
    angle = math.degrees(started.speed * started.dead_centre_time)
    verified("11", f"crank {height} mm above: angle", angle, degrees, within=1e-6)
    verified("11", f"crank {height} mm above: speed", -started.velocity(0.0)[1], speed, within=1e-6, unit="mm/s")
    if time is not None:
        verified("11", f"crank {height} mm above: time", started.dead_centre_time, time, within=PRINTED, unit="s",
                 absolute=True)
    np.testing.assert_allclose(started.displacement(started.dead_centre_time), [0, -height], atol=1e-12)
    assert np.linalg.norm(started.velocity(started.dead_centre_time)) < 1e-9


def test_greatest_speed(verified):
    fastest = max(np.linalg.norm(CRANK.velocity(t)) for t in np.linspace(0, 0.5, 4001))
    verified("11", "crank, greatest speed", fastest, 636.9917, within=1e-6, unit="mm/s")
