"""A contact of less than two elements, or of two steps of a roll, gives a wrong force: the run says so, and what to do."""

import numpy as np
import pytest

import fenics_forming as ff

BALL = """
geometry = "{geometry}"
materials.m.flow_stress = {{ law = "norton_hoff", K = "100 MPa", m = 0.12 }}
workpieces.block = {{ shape = {{ {block} }}, material = "m", mesh_size = "{size} mm"{more} }}
tools.ball = {{ shape = {{ {ball} }}, drive = {{ kind = "speed", velocity = {way} }} }}
tools.base = {{ shape = {{ kind = "plane", point = {base}, normal = {up} }} }}
steps.stroke = "0.1 mm"
stop.stroke = "{stroke} mm"
"""
IN_PLANE = {"block": 'kind = "rectangle", from = [0, 0], to = [20, 20]', "way": '[0, "-1 mm/s"]', "base": "[0, 0]",
            "up": "[0, 1]", "ball": 'kind = "circle", centre = [0, 26], radius = 6'}
IN_SPACE = {"block": 'kind = "box", from = [0, 0, 0], to = [12, 12, 9]', "way": '[0, 0, "-1 mm/s"]', "base": "[0, 0, 0]",
            "up": "[0, 0, 1]", "ball": 'kind = "sphere", centre = [0, 0, 21], radius = 12'}


def ran(tmp_path, out=None, **given):
    path = tmp_path / "ball.toml"
    path.write_text(BALL.format(**{"more": "", "stroke": 0.5} | given), encoding="utf-8")
    simulation = ff.Simulation(ff.read_scene(path))
    return simulation, simulation.run(out)


def said(results):
    return [warning for warning in results.summary["warnings"] if "pressed hardest" in warning]


@pytest.mark.parametrize(("geometry", "more"), [("axisymmetric", ""), ("plane_strain", ', symmetry = ["x"]')])
def test_a_ball_on_one_element_is_warned_of_and_one_on_many_is_not(tmp_path, geometry, more):
    _, coarse = ran(tmp_path, geometry=geometry, size=5, more=more, **IN_PLANE)
    assert len(said(coarse)) == 1 and 'workpieces.block.refine]] kind = "near_tool", tool = "ball"' in said(coarse)[0]
    simulation, fine = ran(tmp_path, geometry=geometry, size=0.8, more=more, **IN_PLANE)
    assert said(fine) == []
    # a ball that has sunk in by d meets the level of the surface over 2 sqrt(2 R d), which counts though half is modelled;
    # material that hardly hardens piles up around it, which makes the contact up to 1.2 times as wide (c² = 1.4)
    width = simulation.contact_sizes.largest["ball"]["width"]
    assert 0.9 < width / (2 * np.sqrt(2 * 6 * 0.5)) < 1.25


def test_the_width_in_space_counts_the_mirrored_halves(tmp_path):
    simulation, results = ran(tmp_path, geometry="3d", size=2, stroke=0.2, more=', symmetry = ["x", "y"]', **IN_SPACE)
    # of a disc, √12 times the radius of gyration is 0.87 diameters, and a few points across are coarse
    width = simulation.contact_sizes.largest["ball"]["width"]
    assert 0.5 < width / (2 * np.sqrt(2 * 12 * 0.2)) < 1.1
    assert bool(said(results)) == (width < 2 * simulation.contact_sizes.largest["ball"]["side"])


def test_what_was_seen_is_kept_by_a_resumed_run(tmp_path):
    simulation, _ = ran(tmp_path, tmp_path / "out", geometry="axisymmetric", size=3, **IN_PLANE)
    path = tmp_path / "ball.toml"
    later = ff.Simulation(ff.read_scene(path), resume=tmp_path / "out" / "checkpoint.npz")
    assert later.contact_sizes.largest == simulation.contact_sizes.largest


def skin_pass(step):
    """Warnings of a strip, 1 mm, that is made 2 % thinner on an arc of √(R Δh) = 1.4 mm, in steps of the roll, mm."""
    radius, leaving = 100.0, 0.98
    angle = np.linspace(np.arccos(1 - 0.01 / radius), 0, 9)
    under = np.column_stack([-radius * np.sin(angle), leaving / 2 + radius * (1 - np.cos(angle))])
    under[:, 1] -= 1.01 * radius * (angle[0] - angle[1]) ** 2 / 8           # its chords stay out of the roll
    back = under[0, 0] - 8
    points = [[back, 0], [4, 0], [4, under[-1, 1]], *under[::-1].tolist(), [back, under[0, 1]]]
    centre = [0, radius + leaving / 2]
    results = ff.simulate(ff.Scene.read({
        "geometry": "plane_strain", "materials": {"m": {"flow_stress": {"law": "constant", "value": 100}}},
        "workpieces": {"strip": {"shape": {"kind": "polygon", "points": points}, "material": "m", "symmetry": ["y"],
                                 "mesh_size": 0.25}},
        "tools": {"roll": {"shape": {"kind": "circle", "centre": centre, "radius": radius},
                           "drive": {"kind": "roll", "centre": centre, "speed": 1},
                           "friction": {"law": "coulomb", "coefficient": 0.2}}},
        "steps": {"time": step / radius}, "stop": {"time": 2 * step / radius}, "output": {"fields_every": 0}}))
    return [warning for warning in results.summary["warnings"] if warning.startswith("the surface of 'roll' moves by")]


def test_steps_in_which_a_roll_takes_the_body_through_its_contact_are_warned_of():
    """Of 2 mm, the force is a third too low; of 0.4 mm, of which four go into the arc, nothing is said."""
    sentence, = skin_pass(2.0)
    assert "moves by 2 mm in a step" in sentence and "take steps of 0." in sentence
    assert skin_pass(0.4) == []
