"""Kinematics of presses: exact, and consistent between place, speed, stroke and time. No mesh."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fenics_forming as ff
from fenics_forming import laws
from fenics_forming.errors import SceneError

CRANK = laws.CrankPressDrive(radius=100, rod=600, speed="60 rpm", direction=[0, -1])
PRESSES = [
    CRANK,
    laws.CrankPressDrive(radius="150 mm", rod="900 mm", speed="60 rpm", direction=[0, -2], dead_centre=25),
    laws.CrankPressDrive(radius=10, rod=10.5, speed=2, direction=[1, 0, 0], dead_centre=19),
    laws.HydraulicDrive(speed="10 mm/s", direction=[0, -1]),
    laws.HydraulicDrive(speed=10, direction=[0, -3], slow_down={"stroke": 7, "speed": 2}),
]


def changed(drive, **keys):
    return type(drive)(**drive.as_table() | keys)


def test_a_crank_press_makes_one_stroke_and_stays_at_the_top():
    down, up = CRANK.turning_times
    assert (down, up) == (pytest.approx(0.5), pytest.approx(1.0))
    np.testing.assert_allclose(CRANK.displacement(up + 3), [0, 0], atol=1e-12)
    assert CRANK.travel(up + 3) == pytest.approx(400)
    assert not CRANK.velocity(up + 3).any()
    assert math.isinf(CRANK.time_of_travel(400.1))


def test_a_hydraulic_press_slows_down_at_its_stroke():
    press = PRESSES[4]
    assert press.turning_times == (0.7,)
    assert press.velocity(0.69).tolist() == [0, -10]
    assert press.velocity(0.7).tolist() == [0, -2]
    assert press.displacement(1.7).tolist() == pytest.approx([0, -9])


@pytest.mark.parametrize("press", PRESSES, ids=lambda p: p.kind)
@given(share=st.floats(1e-3, 0.999))
def test_velocity_is_the_rate_of_place_and_stroke_and_time_is_the_inverse_of_the_stroke(press, share):
    end = press.turning_times[-1] if press.kind == "crank_press" else 2.0
    time, tiny = share * end, 1e-6 * end
    if any(abs(time - turn) < 2 * tiny for turn in press.turning_times):
        return
    rate = (press.displacement(time + tiny) - press.displacement(time - tiny)) / (2 * tiny)
    scale = np.linalg.norm(press.velocity(0.3 * end)) + 1.0
    np.testing.assert_allclose(rate, press.velocity(time), atol=1e-6 * scale)       # central difference, error tiny^2
    assert (press.travel(time + tiny) - press.travel(time - tiny)) / (2 * tiny) == pytest.approx(
        np.linalg.norm(press.velocity(time)), abs=1e-6 * scale)
    assert press.time_of_travel(press.travel(time)) == pytest.approx(time, rel=1e-6)  # flat at the dead centre
    assert not press.displacement(0.0).any()


@pytest.mark.parametrize(("make", "key"), [
    (lambda: changed(CRANK, rod=90), "rod"),
    (lambda: changed(CRANK, dead_centre=201), "dead_centre"),
    (lambda: changed(CRANK, direction=[0, 0]), "direction"),
    (lambda: changed(CRANK, speed="-60 rpm"), "speed"),
    (lambda: changed(PRESSES[4], slow_down={"stroke": 7, "speed": 11}), "slow_down.speed"),
    (lambda: changed(PRESSES[4], slow_down={"stroke": 7}), "slow_down.speed"),
    (lambda: changed(PRESSES[4], direction=[0, 0, 0]), "direction"),
])
def test_a_press_that_cannot_be_is_refused_with_its_key(make, key):
    with pytest.raises(SceneError) as error:
        make()
    assert error.value.key == key


def scene(drive, stop):
    return ff.Scene(
        geometry="axisymmetric",
        materials={"soft": {"flow_stress": {"law": "constant", "value": 100}}},
        workpieces={"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [5, 10]}, "material": "soft",
                               "mesh_size": 2.5}},
        tools={"lower": {"shape": {"kind": "plane", "point": [0, 0], "normal": [0, 1]}},
               "upper": {"shape": {"kind": "plane", "point": [0, 10], "normal": [0, -1]}, "drive": drive}},
        steps={"stroke": 0.5}, stop=stop)


def test_a_run_ends_at_the_dead_centre():
    run = ff.simulate(scene(CRANK.replaced(dead_centre=3), {"dead_centre": True}))
    assert run.summary["stopped"] == "dead centre reached"
    assert run.history.column("stroke_upper_mm")[-1] == pytest.approx(3, abs=1e-12)
    assert run.history.column("time_s")[-1] == CRANK.replaced(dead_centre=3).dead_centre_time
    # the body is 7 mm high, less what the penalty lets it overlap
    assert run.summary["extents_mm"]["billet"]["z"][1] == pytest.approx(7, abs=0.01)


def test_only_a_crank_press_has_a_dead_centre():
    with pytest.raises(SceneError, match="stop.dead_centre: the drive 'speed' of the tool 'upper' has no dead centre"):
        ff.check(scene({"kind": "speed", "velocity": [0, -1]}, {"dead_centre": True}))


DOWN = [0, -1]
HAMMER = {"kind": "hammer", "mass": "100 kg", "energy": ["1 J", "2 J"], "pause": "0.2 s", "lift": "5 mm", "direction": DOWN}


@pytest.mark.parametrize("drive", [
    HAMMER, HAMMER | {"energy": "1 J", "blows": 3, "anvil_mass": "2 t", "efficiency": 0.8},
    {"kind": "screw_press", "energy": "200 J", "speed": "500 mm/s", "direction": DOWN, "stiffness": "500 kN/mm"},
    {"kind": "force", "force": ["1 kN", "2 kN"], "times": [0, 1], "speed": 3, "direction": DOWN},
    {"kind": "force", "force": "1 kN", "speed": 3, "direction": DOWN},
    {"kind": "hydraulic", "speed": 3, "direction": DOWN, "slow_down": {"stroke": 3, "speed": 1}, "force": "3 kN"},
    {"kind": "spring", "stiffness": "1 kN/mm", "direction": DOWN}], ids=lambda d: d["kind"])
def test_every_drive_survives_toml(drive, tmp_path):
    described = scene(drive, {"time": 1.0})
    file = tmp_path / "scene.toml"
    file.write_text(described.to_toml())
    assert ff.read_scene(file) == described
    assert type(described.tools["upper"].drive).__name__ in repr(described)
