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


def plate(flow_stress: dict, mesh: float, time: float) -> ff.Scene:
    """The upper half of a plate of 25 mm on its way to 22 mm between rolls of 500 mm diameter, REFERENCES.md 12.2."""
    radius, entry, exit_ = 250.0, 25.0, 22.0
    arc = np.arccos(1 - (entry - exit_) / (2 * radius))
    angle = np.linspace(arc, 0.0, 25)
    sagitta = 1.01 * radius * (angle[0] - angle[1]) ** 2 / 8
    under = np.column_stack([-radius * np.sin(angle), exit_ / 2 + radius * (1 - np.cos(angle)) - sagitta])
    back, front, centre = under[0, 0] - 40.0, 6.0, [0.0, radius + exit_ / 2]
    points = [[back, 0.0], [front, 0.0], [front, exit_ / 2], *under[::-1].tolist(), [back, entry / 2]]
    return ff.Scene.read({
        "geometry": "plane_strain", "materials": {"metal": {"flow_stress": flow_stress}},
        "workpieces": {"plate": {"shape": {"kind": "polygon", "points": points}, "material": "metal", "symmetry": ["y"],
                                 "mesh_size": mesh}},
        "tools": {"roll": {"shape": {"kind": "circle", "centre": centre, "radius": radius},
                           "drive": {"kind": "roll", "centre": centre, "speed": 1.0},
                           "friction": {"law": "coulomb", "coefficient": 0.12}},
                  "starter": {"shape": {"kind": "plane", "point": [back, 0], "normal": [1, 0]},
                              "drive": {"kind": "speed", "velocity": [0.6 * radius, 0]}}},
        "steps": {"time": 8e-3, "tool": "roll"}, "stop": {"time": time}, "output": {"fields_every": 0},
        "solver": {"max_iterations": 100}})


def test_a_textbook_plate_needs_the_force_of_the_slab_and_about_half_the_arc_for_lever(verified):
    """12.2 with the mean flow stress that the textbook takes, 300 mm wide; the lever of the force is half the length of
    contact. The plate is as thick as the arc is long, and flows less evenly than slabs do."""
    results = ff.simulate(plate({"law": "constant", "value": 175.643}, 2.5, 0.1))
    force, torque = (results.history.column(name)[-6:].mean() for name in ("force_roll_N_per_mm", "torque_roll_Nmm"))
    verified("12.2", "force of a plate of 300 mm, mean flow stress", 300 * force / 1e6, 1.727, within=0.10, unit="MN")
    # the textbook's lever is half the arc; what the rolls give is the work of even flow at least, and that of the slab
    # theory by a few per cent more, as the plate flows less evenly
    even = 2 / np.sqrt(3) * 175.643 * np.log(25 / 22) * 250 * 22
    assert torque > even and 0.5 < 0.5 * torque / (force * 27.3861) < 0.58


@pytest.mark.long
def test_a_plate_that_hardens_needs_the_force_of_the_slab_that_does():
    """12.2 with its hardening, K = 275 MPa and n = 0.15, at the effective strain 2/√3 ln(25/h): the slab of 12.1 needs
    1.867 MN then. Once what the rolls have met first has left them."""
    results = ff.simulate(plate({"law": "swift", "K": 275.0, "n": 0.15, "prestrain": 0.002}, 2.5, 0.18))
    assert 0.3 * results.history.column("force_roll_N_per_mm")[-6:].mean() == pytest.approx(1867, rel=0.08)
