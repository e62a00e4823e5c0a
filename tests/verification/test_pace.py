"""What does not depend on rates is formed alike by all drives, whatever the course of their speed."""

from __future__ import annotations

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.laws import CrankPressDrive, SpeedDrive
from fenics_forming.process.pace import come_to_rest, lapse, mean_pace

WAY, STEPS = 2.0, 8
CRANK = {"kind": "crank_press", "radius": 100, "rod": 600, "speed": 5, "direction": [0, -1], "dead_centre": WAY}
EVEN = {"kind": "speed", "velocity": [0, -10]}


def upsetting(drive, scheme):
    """Of a block with friction, 10 mm high, by a fifth of its height."""
    friction = {"law": "siebel", "factor": 0.3}
    return ff.simulate(ff.Scene.read({
        "geometry": "plane_strain",
        "materials": {"m": {"flow_stress": {"law": "linear", "initial": 250, "hardening": 200}}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 10]}, "material": "m",
                             "mesh_size": 3, "symmetry": ["x"]}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 10], "normal": [0, -1]}, "friction": friction,
                            "drive": drive},
                  "lower": {"shape": {"kind": "plane", "point": [0, 0], "normal": [0, 1]}, "friction": friction}},
        "process": {"shifting": scheme, "volume_constancy": False},
        "steps": {"stroke": WAY / STEPS}, "stop": {"stroke": WAY}, "output": {"fields_every": 0}})).history


@pytest.mark.parametrize(("scheme", "volume"), [("midpoint", 2e-5), ("trapezoid", 2e-5), ("etd2", 3e-4), ("explicit", 2e-3),
                                                ("substeps", 2e-3)])
def test_a_crank_forms_as_a_tool_of_constant_speed_does_up_to_its_dead_centre(scheme, volume):
    """Also in its last step, in which it comes to rest: body and tool go equally far. Forces differ by what slow points of
    the body, which the regularisation relates to the speed of the tool, add; volumes by the order of the scheme."""
    crank, even = upsetting(CRANK, scheme), upsetting(EVEN, scheme)
    stroke = crank.column("stroke_upper_mm")
    assert np.allclose(stroke, even.column("stroke_upper_mm"), atol=1e-6)
    assert crank.column("force_upper_N_per_mm") == pytest.approx(even.column("force_upper_N_per_mm"), rel=3e-3)
    assert crank.column("volume_error_b") == pytest.approx(even.column("volume_error_b"), abs=volume)
    spent = crank.column("newton_iterations")
    assert spent[-1] <= spent[1:-1].max() + 4, "the dead centre costs no more than other steps"


def test_half_of_the_way_is_done_before_half_of_the_time_where_a_tool_slows_down():
    crank = CrankPressDrive(**{key: value for key, value in CRANK.items() if key != "kind"})
    end, dt = crank.dead_centre_time, 0.01
    # near its dead centre the speed falls evenly: all but √½ of the time
    assert lapse({"a": crank}, end - dt, dt, 0.5) / dt == pytest.approx(1 - np.sqrt(0.5), rel=2e-3)
    assert mean_pace({"a": crank}, end - dt, end - dt, dt).share == pytest.approx(0.5, rel=1e-3)
    assert come_to_rest({"a": crank}, end - dt, dt) and not come_to_rest({"a": crank}, end - 2 * dt, dt)


def test_tools_that_change_their_speed_in_other_ways_leave_the_flow_as_it_is():
    crank = CrankPressDrive(**{key: value for key, value in CRANK.items() if key != "kind"})
    speed = SpeedDrive(velocity=[0, 10])
    assert mean_pace({"a": crank, "b": speed}, 0.0, 0.0, 0.01).share == 1.0
    assert lapse({"a": crank, "b": speed}, 0.0, 0.01, 0.5) == 0.005
    assert not come_to_rest({"a": speed}, 0.0, 0.01) and not come_to_rest({}, 0.0, 0.01)
