"""Springs, free rolls and presses at their force limit: what the solve finds of the motion of a tool."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.errors import SceneError
from tests.stability.test_ranks import on_ranks, same

from .test_energy_driven import Break, cylinder, height

AREA = math.pi * 100
HARDENING = {"law": "linear", "initial": 100, "hardening": 50}
PRESS = {"kind": "hydraulic", "speed": 10, "direction": [0, -1]}


def height_at(force: float) -> float:
    """Height of the hardening cylinder of 20 mm and R 10 mm at which it resists with a force, N."""
    heights = np.linspace(5, 20, 150001)
    return float(np.interp(-force, -(100 + 50 * np.log(20 / heights)) * AREA * 20 / heights, heights))


def counter_spring(stiffness: float) -> ff.Scene:
    table = cylinder({"kind": "speed", "velocity": [0, -1]}, stop={"stroke": 5.0}, step=0.5).as_table()
    table["tools"]["anvil"]["drive"] = {"kind": "spring", "stiffness": stiffness, "direction": [0, 1]}
    return ff.Scene.read(table)


def test_a_press_with_a_force_limit_comes_to_rest_where_the_body_resists_as_much():
    limit = 60e3
    results = ff.simulate(cylinder(PRESS | {"force": limit}, stress=HARDENING, step=0.25, stop={"stroke": 15.0}))
    assert "force limit" in results.summary["stopped"]
    force, stroke = results.history.column("force_ram_N"), results.history.column("stroke_ram_mm")
    assert force.max() == pytest.approx(limit, rel=1e-3), "held back a little below it, at 1 % of its speed"
    assert height(results) == pytest.approx(height_at(force[-1]), rel=5e-3)
    assert 20 - height(results) == pytest.approx(stroke[-1], abs=1e-3), "the stroke is that of the tool"
    speed = np.diff(stroke) / np.diff(results.history.column("time_s"))
    fast = force[1:] < 0.94 * limit
    np.testing.assert_allclose(speed[fast], 10, rtol=1e-6)
    slowed = speed[-3:] / 10
    assert (slowed < 0.5).all() and (np.diff(speed[~fast]) < 0).all(), "slower and slower"


@pytest.mark.parametrize("scheme", ["midpoint", "trapezoid"])
def test_a_force_drive_presses_a_rate_dependent_body_as_fast_as_it_yields(scheme):
    r"""Norton body: :math:`\dot h=-h\,(F/(KA))^{1/m}`, A h = V, so that the height after a time is known by quadrature. The
    ram moves by the velocity that moves the body, also where that is a mean: no volume is lost between them."""
    stress, force, m = {"law": "norton_hoff", "K": 100, "m": 0.5}, 20e3, 0.5
    drive = {"kind": "force", "force": force, "speed": 1000, "direction": [0, -1]}
    results = ff.simulate(cylinder(drive, stress=stress, steps={"time": 0.05, "scheme": scheme}, stop={"time": 1.0}))
    heights = np.linspace(20, 5, 200001)
    rate = (force * heights / (100 * AREA * 20)) ** (1 / m) * heights
    times = np.concatenate([[0], np.cumsum(np.diff(-heights) * (1 / rate[1:] + 1 / rate[:-1]) / 2)])
    assert height(results) == pytest.approx(np.interp(1.0, times, heights), rel=2e-3)      # 20 steps of second order
    np.testing.assert_allclose(results.history.column("force_ram_N"), force, rtol=2e-3)
    assert abs(results.history.column("volume_error_billet")[-1]) < 3e-4


def test_a_rising_force_forms_as_far_as_the_body_resists_it():
    drive = {"kind": "force", "force": ["20 kN", "60 kN"], "times": [0, 1], "speed": 30, "direction": [0, -1]}
    results = ff.simulate(cylinder(drive, stress=HARDENING, steps={"time": 0.02}, stop={"stroke": 15}))
    assert "force limit" in results.summary["stopped"] and results.history.column("time_s")[-1] >= 1.0
    time, force, stroke = (results.history.column(n) for n in ("time_s", "force_ram_N", "stroke_ram_mm"))
    rising = (time > 0.45) & (time < 0.99)
    np.testing.assert_allclose(force[rising], 20e3 + 40e3 * time[rising], rtol=2e-3)
    assert stroke[time < 0.28].max() < 1e-3, "below the force of yielding it stands still"
    np.testing.assert_allclose(stroke[rising], [20 - height_at(20e3 + 40e3 * t) for t in time[rising]], atol=0.02)
    assert height(results) == pytest.approx(height_at(60e3), rel=5e-3)


def test_a_spring_gives_way_by_the_force_over_its_stiffness():
    results = ff.simulate(counter_spring(2e4))
    force, way = results.history.column("force_ram_N"), results.history.column("deflection_anvil_mm")
    # recorded is the force that the next half step will see
    np.testing.assert_allclose(force[4:] / 2e4, way[4:], rtol=2e-2)
    low, high = results.summary["extents_mm"]["billet"]["z"]
    assert -low == pytest.approx(way[-1], abs=2e-3) and high == pytest.approx(15, abs=2e-3)
    # REFERENCES.md 10.1 with the spring below: h = [(h0-s) + sqrt((h0-s)^2 + 4 F0 h0/K)] / 2
    assert height(results) == pytest.approx((15 + math.sqrt(15**2 + 4 * 100 * AREA * 20 / 2e4)) / 2, rel=5e-3)


def limited_on_a_spring() -> ff.Scene:
    table = cylinder(PRESS | {"force": 40e3}, stress=HARDENING, step=0.5, stop={"stroke": 10.0}).as_table()
    table["tools"]["anvil"]["drive"] = {"kind": "spring", "stiffness": 2e4, "direction": [0, 1]}
    return ff.Scene.read(table)


def test_a_press_at_its_limit_and_a_spring_go_on_where_they_were_interrupted(tmp_path):
    whole = ff.simulate(limited_on_a_spring(), tmp_path / "whole")
    last = len(whole.history) - 1
    for step in (3, last - 3):
        with pytest.raises(KeyboardInterrupt):
            ff.simulate(limited_on_a_spring(), tmp_path / str(step), observer=Break(step))
        saved = tmp_path / str(step) / "checkpoint.npz"
        again = ff.Simulation(limited_on_a_spring(), resume=saved).run(tmp_path / str(step))
        same(whole.history, again.history, within=1e-10)


@pytest.mark.mpi
def test_two_ranks_find_the_same_motion(tmp_path):
    scene = limited_on_a_spring()
    same(ff.simulate(scene, tmp_path / "one").history, on_ranks(2, scene.to_toml(), tmp_path / "two").history)


@pytest.mark.parametrize(("drive", "message"), [
    (PRESS | {"slows_from": 0.9}, "tools.ram.drive.slows_from: has no meaning without 'force'"),
    (PRESS | {"force": "3 MPa"}, "tools.ram.drive.force: '3 MPa' has the wrong dimension"),
    ({"kind": "force", "force": 100, "direction": [0, -1]}, "tools.ram.drive.speed: is missing"),
    ({"kind": "force", "force": -100, "speed": 1, "direction": [0, -1]}, "tools.ram.drive.force: -100 is not positive"),
    ({"kind": "force", "force": [1, 2], "speed": 1, "direction": [0, -1]}, "drive.force: is a list; expected 'times'"),
    ({"kind": "force", "force": [1, 2], "times": [1, 2], "speed": 1, "direction": [0, -1]}, "drive.times: are not rising"),
    ({"kind": "spring", "stiffness": 0, "direction": [0, -1]}, "tools.ram.drive.stiffness: .* is not positive"),
    ({"kind": "spring", "stiffness": 10, "direction": [0, -1]}, "tools: no tool moves"),
    ({"kind": "roll", "centre": [0, 30]}, "tools.ram.drive: turns the tool out of its axisymmetry"),
    ({"kind": "roll", "centre": [0, 30], "speed": 1, "torque": 2}, "tools.ram.drive.torque: is given together with"),
])
def test_drives_that_cannot_be_are_refused(drive, message):
    with pytest.raises(SceneError, match=message):
        ff.check(cylinder(drive, stop={"stroke": 5.0}))


def test_a_tool_cannot_follow_one_whose_motion_the_solve_finds():
    table = cylinder(PRESS | {"force": 40e3}, stop={"stroke": 5.0}).as_table()
    table["tools"]["anvil"]["drive"] = {"kind": "ratio", "of": "ram", "ratio": 0.5, "direction": [0, 1]}
    with pytest.raises(SceneError, match="tools.anvil.drive.of: 'ram' yields at its force limit"):
        ff.check(ff.Scene.read(table))
