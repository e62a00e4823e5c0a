"""How runs start: tools on a long way, tools that never come, a strip that only touches its roll."""

import numpy as np
import pytest

import fenics_forming as ff


class Listener:
    """Keeps what a run says."""

    def __init__(self):
        self.notes = []

    def note(self, sentence):
        self.notes.append(sentence)

    def __getattr__(self, _):
        return lambda *_: None


def upsetting(lift, *, stroke, drive=None, direction=-1.0):
    """A cylinder of 10 mm, half of it, and a platen ``lift`` above it."""
    return ff.Scene.read({
        "geometry": "axisymmetric", "materials": {"m": {"flow_stress": {"law": "constant", "value": 100}}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 10]}, "material": "m",
                             "symmetry": ["z"], "mesh_size": 4}},
        "tools": {"p": {"shape": {"kind": "plane", "point": [0, 10 + lift], "normal": [0, -1]},
                        "drive": drive or {"kind": "speed", "velocity": [0, direction]}}},
        "steps": {"stroke": 0.5}, "stop": {"stroke": stroke}, "output": {"fields_every": 0}})


@pytest.mark.parametrize("lift, stroke, direction, said", [
    (5.0, 3.0, -1.0, "'p' ends 2 mm away"), (1.0, 3.0, 1.0, "'p' ends 4 mm away"), (0.0, 3.0, 1.0, "a tool only pushes")])
def test_a_run_in_which_no_tool_touches_says_so(lift, stroke, direction, said):
    heard = Listener()
    results = ff.simulate(upsetting(lift, stroke=stroke, direction=direction), observer=heard)
    sentence, = [w for w in results.summary["warnings"] if "no tool ever pressed on the body" in w]
    assert said in sentence and any(said in note for note in heard.notes)


def test_a_run_that_touches_says_nothing_of_the_kind():
    assert not any("no tool" in w for w in ff.simulate(upsetting(1.0, stroke=2.0)).summary["warnings"])


@pytest.mark.parametrize("drive", [
    None, {"kind": "hammer", "mass": "10 kg", "energy": "100 J", "direction": [0, -1]},
    {"kind": "table", "direction": [0, -1], "times": [0, 1, 60], "displacement": [0, 2, 61]}])
def test_a_long_way_to_the_body_takes_few_steps_and_ends_where_the_tool_touches(drive):
    near, far = (ff.simulate(upsetting(lift, stroke=lift + 1, drive=drive)).history for lift in (0.0, 57.0))
    stroke, force = far.column("stroke_p_mm"), far.column("force_p_N")
    assert np.sum(force == 0) < 20 and np.isclose(stroke[force > 0][0], 57, atol=1e-6)
    # a ram slows down in steps of its own: the forces are those over the way, not row by row
    expected = np.interp(stroke[force > 0] - 57, near.column("stroke_p_mm"), near.column("force_p_N"))
    np.testing.assert_allclose(force[force > 0], expected, rtol=1e-6 if drive is None else 6e-3)


def test_a_crank_that_changes_its_speed_on_the_way_comes_in_steps_as_asked():
    crank = {"kind": "crank_press", "radius": 50, "rod": 250, "speed": "60 rpm", "direction": [0, -1], "dead_centre": 21}
    history = ff.simulate(upsetting(20.0, stroke=20.5, drive=crank)).history
    assert np.isclose(history.column("stroke_p_mm")[history.column("force_p_N") > 0][0], 20, atol=1e-3)


def test_a_strip_whose_corner_touches_the_roll_is_drawn_in():
    """Coulomb friction at one point: the first flow is found with contact looking less far ahead."""
    entry, leaving, radius = 1.5, 1.2, 100.0
    x = np.sqrt(radius**2 - (radius - (entry - leaving)) ** 2)
    scene = ff.Scene.read({
        "geometry": "plane_strain", "materials": {"m": {"flow_stress": {"law": "constant", "value": 400}}},
        "workpieces": {"strip": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [12, entry]}, "material": "m",
                                 "symmetry": ["y"], "mesh_size": 0.6}},
        "tools": {"roll": {"shape": {"kind": "circle", "centre": [12 + x, radius + leaving], "radius": radius},
                           "drive": {"kind": "roll", "centre": [12 + x, radius + leaving], "speed": "60 rpm"},
                           "friction": {"law": "coulomb", "coefficient": 0.1}},
                  "pusher": {"shape": {"kind": "plane", "point": [0, 0], "normal": [1, 0]},
                             "drive": {"kind": "speed", "velocity": [300, 0]}}},
        "steps": {"time": 1e-3}, "stop": {"time": 5e-3}, "output": {"fields_every": 0}})
    history = ff.simulate(scene).history
    force = history.column("force_roll_N_per_mm")
    assert force[-1] > 800 and np.all(np.diff(force[-3:]) > 0), "more and more of the strip is in the gap"


def strip_before_a_roll(friction, entry=2.0, leaving=1.6, radius=100.0, bite=0.3):
    """The upper half of a strip, nothing behind it; its front follows the roll over a part of the draught."""
    centre = [0.0, radius + leaving / 2]
    front = entry / 2 - bite * (entry - leaving) / 2
    angle = np.linspace(np.arccos((centre[1] - entry / 2) / radius), np.arccos((centre[1] - front) / radius), 9)
    arc = np.column_stack([-radius * np.sin(angle), centre[1] - radius * np.cos(angle)])
    arc[:, 1] -= 1.01 * radius * (angle[0] - angle[1]) ** 2 / 8         # its chords stay out of the roll
    back = arc[0, 0] - 4 * entry
    scene = ff.Scene.read({
        "geometry": "plane_strain", "materials": {"m": {"flow_stress": {"law": "constant", "value": 100}}},
        "workpieces": {"strip": {"shape": {"kind": "polygon", "points": [
            [back, 0.0], [arc[-1, 0], 0.0], *arc[::-1].tolist(), [back, arc[0, 1]]]}, "material": "m", "symmetry": ["y"],
            "mesh_size": entry / 6}},
        "tools": {"roll": {"shape": {"kind": "circle", "centre": centre, "radius": radius},
                           "drive": {"kind": "roll", "centre": centre, "speed": 1.0},
                           "friction": {"law": "coulomb", "coefficient": friction}}},
        "steps": {"time": 2e-3}, "stop": {"time": 4e-3}, "output": {"fields_every": 0}})
    return scene, np.sin(angle).mean()      # what a unit pressure pushes back; its rest, the cosine, is nearly one


def test_rolls_bite_up_to_the_angle_of_friction_and_say_so_beyond_it():
    """A strip that nothing pushes is drawn in if friction is more than the tangent of the mean angle at which the rolls
    touch it, 3.3 degrees: the chords of the arc know that to a few per cent."""
    lean = strip_before_a_roll(0.1)[1]
    history = ff.simulate(strip_before_a_roll(1.06 * lean)[0], observer=(heard := Listener())).history
    force = history.column("force_roll_N_per_mm")
    assert not heard.notes or not any("cut" in note for note in heard.notes)
    assert len(force) == 3 and np.all(np.diff(force) > 0), "drawn in"
    with pytest.raises(ff.ConvergenceError, match=r"leans by 3\.3 degrees .* friction holds up to 3\.1: it slips out"):
        ff.simulate(strip_before_a_roll(0.93 * lean)[0])
