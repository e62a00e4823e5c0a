"""Free space, late contact, turning tools, limits, interrupts: a run ends in words and leaves its results."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming import cli
from fenics_forming.physics.newton import FlowSolver
from fenics_forming.process.integration import Midpoint
from fenics_forming.results import Results
from fenics_forming.simulation import Simulation
from fenics_forming.simulation.stepping import Stepper

from .scenes import BILLET, BLOCK, COARSE_BILLET, CUBE, PUNCHES, Listener, read, run, scene_file, swept

ALONE = BLOCK[:BLOCK.index("[tools.lower]")] + BLOCK[BLOCK.index("[steps]"):]     # the lower plate taken away


def table(times, displacement) -> str:
    return (f"tools.upper.drive={{ kind = 'table', direction = [0, -1], times = {times}, "
            f"displacement = {displacement} }}")


def forces(outcome) -> np.ndarray:
    return outcome.results.history.column("force_upper_N_per_mm")


# ---------------------------------------------------------------------- nothing on the far side
def test_body_pushed_into_free_space_is_told_that_nothing_opposes_it(tmp_path):
    """It goes along with the tool, without force and without deformation: what remains when inertia is left out."""
    outcome = run(ALONE, tmp_path)
    assert outcome.failure is None
    assert np.abs(forces(outcome)).max() < 1e-3
    assert outcome.last["max_effective_strain"] < 1e-6
    top = outcome.results.summary["extents_mm"]["block"]["y"][1]
    assert top == pytest.approx(2 - outcome.last["stroke_upper_mm"], abs=1e-6)
    assert any("nothing opposes the tool 'upper'" in note for note in outcome.heard.notes), "said at the start, too"


def test_a_start_that_finds_no_flow_is_cut_and_the_run_goes_on(tmp_path, monkeypatch):
    """A free roll on a strip that is pushed 2 mm a step found no first flow while contact looked that far ahead (random
    operations); here the two first attempts fail by themselves. What they leave behind does not count."""
    short = 0.05 / 64
    whole = run(BLOCK, tmp_path / "whole", f"steps.stroke={short}", f"stop.stroke={short}")
    solve, tried = FlowSolver.solve, []

    def fails_twice(solver, **given):
        tried.append(given)
        if len(tried) < 3:
            solver.workpiece.solution.x.array[:] = 1e3
            raise ff.ConvergenceError("no flow", history=["none"], advice="none")
        return solve(solver, **given)

    monkeypatch.setattr(FlowSolver, "solve", fails_twice)
    outcome = run(BLOCK, tmp_path / "cut")
    assert outcome.failure is None
    assert [note for note in outcome.heard.notes if "cut" in note] == ["step 1 cut: no flow"] * 2
    assert forces(outcome)[0] == pytest.approx(forces(whole)[0], rel=1e-6), "that of a start that looks as far ahead"


def test_failure_in_the_first_solve_leaves_the_body_as_it_was_and_the_reason(tmp_path, capsys):
    """No row and no checkpoint, since nothing was solved; and none of an earlier run in the same folder either."""
    run(BLOCK, tmp_path, "stop.stroke=0.1")
    outcome = run(BLOCK, tmp_path, "solver.max_iterations=2", "tools.upper.friction={ law = 'sticking' }")
    assert len(outcome.results.history) == 0 and len(outcome.results.frames) == 1
    assert sorted(p.name for p in tmp_path.iterdir() if p.suffix not in (".vtu", ".pvd")) == \
        ["scene.toml", "scene_in.toml", "summary.json"]
    assert cli.main(["info", str(tmp_path)]) == 0
    assert "failed: the flow did not converge" in capsys.readouterr().out


# ---------------------------------------------------------------------- late contact
def test_tool_from_afar_presses_only_when_it_touches_and_touches_exactly(tmp_path):
    """Free travel of 0.12 mm: no force, no deformation, the stroke counts; then the same as without the way."""
    outcome = run(BLOCK, tmp_path, "tools.upper.shape.point=[0, 2.12]", "stop.stroke='0.42 mm'")
    history = outcome.results.history
    stroke = history.column("stroke_upper_mm")
    touch = int(np.argmin(np.abs(stroke - 0.12)))
    assert stroke[touch] == pytest.approx(0.12, rel=1e-12)
    assert outcome.heard.limited_by[touch] == "contact"
    assert (forces(outcome)[:touch] == 0).all() and (forces(outcome)[touch:] > 500).all()
    assert (history.column("max_effective_strain")[: touch + 1] == 0).all()
    assert (history.column("power_imbalance")[:touch] == 0).all()
    near = run(BLOCK, tmp_path / "near", "stop.stroke='0.3 mm'")
    assert forces(outcome)[touch:] == pytest.approx(forces(near), rel=5e-3), "the tolerance of the Newton, twice"


@pytest.mark.parametrize("place", [2.0, 2.1], ids=["over_a_node", "between_two_nodes"])
def test_round_tool_is_met_where_it_first_touches(place, tmp_path):
    """A circle over a plane face: the gaps at the integration points are not linear in time, yet nothing sinks in.

    Nodes count too: over one of them the points around are reached only by pushing it in, in ever smaller steps.
    """
    outcome = run(BLOCK, tmp_path, f"tools.upper.shape={{ kind = 'circle', centre = [{place}, 5.13], radius = 3 }}",
                  "stop.stroke='0.2 mm'")
    assert outcome.heard.limited_by.count("contact") == 1
    stroke = outcome.results.history.column("stroke_upper_mm")
    first = stroke[np.flatnonzero(forces(outcome))[0]]
    # a side is 0.5 mm long, its points lie up to 0.09 mm from the lowest point: there the circle is 1 um higher
    assert 0.13 * (1 - 1e-12) <= first < 0.133
    assert (np.diff(forces(outcome)[stroke >= first]) > 0).all(), "the contact of a circle only widens"


def test_tool_that_never_arrives_changes_nothing(tmp_path):
    outcome = run(BLOCK, tmp_path, "tools.upper.shape.point=[0, 3]")
    assert outcome.results.summary["stopped"] == "stroke 0.5 mm reached"
    assert (forces(outcome) == 0).all() and outcome.results.summary["newton_iterations"] == 0
    assert outcome.last["volume_error_block"] == 0


def test_body_that_floats_between_its_tools_is_pressed_when_both_have_it_or_fails_with_advice(tmp_path):
    """The upper plate pushes the block down to the lower one: free flight, which rigid-plastic flow barely carries."""
    outcome = run(BLOCK, tmp_path, "tools.upper.shape.point=[0, 2.12]", "tools.lower.shape.point=[0, -0.08]")
    if outcome.failure is None:
        assert outcome.results.summary["extents_mm"]["block"]["y"] == pytest.approx([-0.08, 1.62], abs=1e-4)


# ---------------------------------------------------------------------- runs that cannot go on
@pytest.mark.parametrize(("text", "changes"), [
    (BILLET, (*COARSE_BILLET, "solver.penalty_factor=0.1", "solver.augmented=false")),
    pytest.param(BILLET, (*COARSE_BILLET, "stop.stroke=14.8"), marks=pytest.mark.long),
    pytest.param(PUNCHES, ("stop.stroke=3", "steps.stroke=0.2"), marks=pytest.mark.long),
    pytest.param(CUBE, ("tools.upper.friction={ law = 'sticking' }", "stop.stroke=1.8", "steps.stroke=0.2"),
                 marks=pytest.mark.long),
], ids=["sunken", "flat billet", "deep punches", "flat sticking cube"])
def test_inverted_cells_end_the_run_with_all_results(text, changes, tmp_path):
    """Steps are cut first; then the advice; what went well before is on disk and can be read (``whole``)."""
    outcome = run(text, tmp_path, *changes)
    assert outcome.failure is not None and "inverted" in str(outcome.failure)
    assert "too distorted" in outcome.failure.advice
    assert len(outcome.results.history) > 3
    again = run(text, tmp_path, *changes, resume=True)
    assert again.failure is not None, "resumed it fails again, where it failed"
    steps = again.results.history.column("step")
    assert (np.diff(steps) == 1).all()


def test_a_step_that_fails_on_a_new_mesh_too_leaves_the_state_on_that_mesh(tmp_path, monkeypatch):
    """The mesh is renewed where a step fails. What is written then, and gone on from, belongs to the new mesh."""
    def advance(self, body, start, time, history, dt):
        if time > 0.65:
            raise ff.ConvergenceError("this step is not to converge", advice="let it converge")
        return whole_step(self, body, start, time, history, dt)

    whole_step = Midpoint.advance
    monkeypatch.setattr(Midpoint, "advance", advance)
    changes = ("workpieces.block.remesh=true", "steps.stroke=0.1", "stop.stroke=1", "workpieces.block.temperature=20",
               "materials.lead.flow_stress={ law = 'hensel_spittel', A = 100, m1 = -0.001 }")
    outcome = run(BLOCK, tmp_path, *changes)
    assert "fails however short it is" in str(outcome.failure)
    assert any("new mesh" in note for note in outcome.heard.notes)
    monkeypatch.undo()
    again = run(BLOCK, tmp_path, *changes, resume=True)
    assert again.failure is None and again.last["stroke_upper_mm"] == pytest.approx(1.0)


def test_failed_run_has_exit_code_1_and_says_why_once(tmp_path, capsys):
    path = scene_file(BILLET, tmp_path)
    changes = [f"--set={change}" for change in (*COARSE_BILLET, "solver.penalty_factor=0.1", "solver.augmented=false")]
    assert cli.main(["run", str(path), "--out", str(tmp_path), "--quiet", *changes]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("the run failed: step ") and said.err.count("too distorted") == 1
    assert len(said.err.splitlines()) == 1


def test_iteration_limit_cuts_steps_until_none_is_short_enough(tmp_path):
    """The first contact needs a cold start of nine iterations; four are allowed, in however short a step."""
    outcome = run(BLOCK, tmp_path, "solver.max_iterations=4", "tools.upper.shape.point=[0, 2.12]")
    assert outcome.failure is not None and "fails however short it is" in str(outcome.failure)
    assert "after 4 iterations" in str(outcome.failure) and "smaller step" in outcome.failure.advice
    assert sum("cut" in note for note in outcome.heard.notes) >= 9, "halved down to a thousandth"


def test_iteration_limit_that_the_first_solve_breaks(tmp_path):
    outcome = run(BLOCK, tmp_path, "solver.max_iterations=2")
    assert outcome.failure is not None and "after 2 iterations" in str(outcome.failure)


# ---------------------------------------------------------------------- interrupted
def test_interrupted_run_leaves_readable_results_and_goes_on(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        Simulation(read(BLOCK, tmp_path)).run(tmp_path, observer=Listener(interrupt_after=4))
    left = Results.read(tmp_path)
    assert left.summary["stopped"] == "interrupted" and left.history.rows[-1]["step"] == 4
    assert left.frames[-1][0] == pytest.approx(0.2)
    outcome = run(BLOCK, tmp_path, resume=True)
    assert outcome.last["step"] == 10


def test_interrupt_in_the_middle_of_a_step_leaves_the_state_before_it(tmp_path, monkeypatch):
    """Nodes that have moved half a step must not reach the checkpoint."""
    simulation = Simulation(read(BLOCK, tmp_path))
    solve, calls = simulation.body.solve, []

    def interrupted(*args, **more):
        calls.append(args)
        if len(calls) == 8:      # the start, then two a step: the middle of the fourth step
            raise KeyboardInterrupt
        return solve(*args, **more)

    monkeypatch.setattr(simulation.body, "solve", interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulation.run(tmp_path)
    left = Results.read(tmp_path)
    assert left.history.rows[-1]["step"] == 3
    assert left.summary["extents_mm"]["block"]["y"] == pytest.approx([0, 1.85], abs=1e-9)


def test_interrupt_on_the_command_line_is_130(tmp_path, monkeypatch, capsys):
    def interrupted(*args, **more):
        raise KeyboardInterrupt

    monkeypatch.setattr(Stepper, "advance", interrupted)
    assert cli.main(["run", str(scene_file(BLOCK, tmp_path)), "--out", str(tmp_path), "--quiet"]) == 130
    assert "--resume" in capsys.readouterr().err
    assert json.loads((tmp_path / "summary.json").read_text())["stopped"] == "interrupted"


# ---------------------------------------------------------------------- tools that stop, dwell and turn
ENDED, RESTING, BACK = table([0, 0.2], [0, 0.2]), table([0, 0.2, 1], [0, 0.2, 0.2]), table([0, 0.2, 0.3], [0, 0.2, 0.1])
BY_STROKE, BY_TIME = "steps={ stroke = 0.05 }", "steps={ time = 0.05 }"
AT_FORCE, AT_HEIGHT = "stop={ force = '5 kN/mm' }", "stop={ height = '1 mm' }"
NEVER = [(ENDED, BY_STROKE, AT_FORCE), (ENDED, BY_TIME, AT_HEIGHT), (RESTING, BY_STROKE, AT_HEIGHT),
         (BACK, BY_STROKE, AT_FORCE)]
MORE_NEVER = [case for case in product((ENDED, RESTING, BACK), (BY_STROKE, BY_TIME), (AT_FORCE, AT_HEIGHT))
              if case not in NEVER]


@pytest.mark.parametrize(("drive", "steps", "stop"), swept(NEVER, MORE_NEVER))
def test_drive_that_ends_before_the_stop_ends_the_run_in_words(drive, steps, stop, tmp_path):
    """It stands still, or goes back: neither an endless loop nor a step of zero."""
    outcome = run(BLOCK, tmp_path, drive, steps, stop)
    assert outcome.failure is None
    assert outcome.results.summary["stopped"].startswith("no tool comes towards the body any more")
    pressed = outcome.results.at(time=0.2)
    assert pressed["force_upper_N_per_mm"] == pytest.approx(641, rel=0.01), "the force just before it stands still"


def test_force_at_the_end_of_a_table_is_that_of_the_moving_tool(tmp_path):
    """As with a steady speed: at its last time a table has a velocity before and none after."""
    steady = run(BLOCK, tmp_path / "steady", "stop={ stroke = 0.2 }")
    ended = run(BLOCK, tmp_path / "table", table([0, 0.2], [0, 0.2]), "stop={ stroke = 0.2 }")
    assert forces(ended) == pytest.approx(forces(steady), rel=1e-9)


@pytest.mark.parametrize("scheme", swept(["etd2", "midpoint"], ["explicit", "trapezoid"]))
def test_withdrawn_tool_feels_nothing_and_the_body_rests(scheme, tmp_path):
    outcome = run(BLOCK, tmp_path, table([0, 0.2, 0.4], [0, 0.2, 0]), "stop={ time = 0.4 }", f"steps.scheme='{scheme}'")
    time, history = outcome.results.history.column("time_s"), outcome.results.history
    assert (forces(outcome)[time <= 0.2] > 500).all()
    assert (forces(outcome)[time > 0.2] == 0).all()
    for column in ("max_effective_strain", "volume_block_mm3"):
        values = history.column(column)[time >= 0.2]
        assert values == pytest.approx(values[0], rel=1e-14), "it keeps its shape"
    assert outcome.results.summary["extents_mm"]["block"]["y"][1] == pytest.approx(1.8, abs=1e-6)
    assert outcome.last["stroke_upper_mm"] == pytest.approx(0.4)


@pytest.mark.parametrize("scheme", swept(["etd2", "midpoint"], ["explicit", "trapezoid"]))
def test_dwell_changes_nothing_but_the_time(scheme, tmp_path):
    """Down 0.2, wait 0.2 s, down 0.2: no step runs across the jumps of the speed, whatever the step."""
    changes = f"steps.scheme='{scheme}'", "steps.stroke=0.03", "stop={ time = 0.6 }", "output.strokes=[0.2]"
    waited = run(BLOCK, tmp_path, table([0, 0.2, 0.4, 0.6], [0, 0.2, 0.2, 0.4]), *changes)
    steady = run(BLOCK, tmp_path / "steady", changes[0], changes[1], "stop={ stroke = 0.4 }", changes[3])
    time = waited.results.history.column("time_s")
    assert {0.2, 0.4, 0.6} <= {round(t, 12) for t in time}
    assert (forces(waited)[(time > 0.2 + 1e-9) & (time < 0.4 + 1e-9)] == 0).all()
    # etd2 starts anew after the pause, without what it knew of the flow: its first order then is seen
    assert waited.last["force_upper_N_per_mm"] == pytest.approx(steady.last["force_upper_N_per_mm"], rel=0.02)
    assert waited.last["volume_error_block"] == pytest.approx(steady.last["volume_error_block"], abs=2e-4)


def test_body_met_again_after_a_withdrawal_goes_on_yielding_where_it_stopped(tmp_path):
    """Down 0.2, up 0.1, down 0.2: the way back through the gap costs nothing and takes no strain."""
    outcome = run(BLOCK, tmp_path, table([0, 0.2, 0.3, 0.5], [0, 0.2, 0.1, 0.3]), "stop={ time = 0.5 }")
    history = outcome.results.history
    time = history.column("time_s")
    first, second = (int(np.argmin(np.abs(time - t))) for t in (0.2, 0.4))
    assert time[second] == pytest.approx(0.4, abs=1e-6), "touches where it had left"
    assert (forces(outcome)[first + 1: second] == 0).all()
    assert forces(outcome)[second] == pytest.approx(forces(outcome)[first], rel=5e-3)


# ---------------------------------------------------------------------- stops
def test_stop_by_time_and_stroke_is_exact(tmp_path):
    for change, column, value in (("stop={ time = 0.333 }", "time_s", 0.333),
                                  ("stop={ stroke = 0.123 }", "stroke_upper_mm", 0.123)):
        assert run(BLOCK, tmp_path, change).last[column] == pytest.approx(value, rel=1e-12)


def test_stop_by_height_is_exact(tmp_path):
    outcome = run(BLOCK, tmp_path, "stop={ height = '1.777 mm' }")
    assert np.ptp(outcome.results.summary["extents_mm"]["block"]["y"]) == pytest.approx(1.777, rel=1e-6)
    assert outcome.heard.limited_by[-1] == "target" and outcome.results.summary["stopped"] == "height 1.777 mm reached"


def test_stop_by_force_is_exact(tmp_path):
    outcome = run(BLOCK, tmp_path, "stop={ force = '600 N/mm' }")
    assert (forces(outcome)[:-1] < 600).all()
    assert forces(outcome)[-1] == pytest.approx(600, rel=1e-3)


def test_stop_by_a_force_that_is_jumped_over_at_first_contact_ends_there(tmp_path):
    """A perfectly plastic block takes its limit load at once."""
    outcome = run(BLOCK, tmp_path, "tools.upper.shape.point=[0, 2.12]", "stop={ force = '60 N/mm' }")
    assert (forces(outcome)[:-1] == 0).all() and forces(outcome)[-1] > 500


def test_first_of_several_stops_counts(tmp_path):
    outcome = run(BLOCK, tmp_path, "stop={ force = '5 kN/mm', stroke = 0.4, height = 1.9, time = 3 }")
    assert outcome.results.summary["stopped"] == "height 1.9 mm reached"


def test_error_of_another_kind_still_writes_the_summary(tmp_path, monkeypatch):
    """What nobody foresaw is not hidden, and what was computed is not lost."""
    def broken(*args):
        raise ZeroDivisionError("not foreseen")

    monkeypatch.setattr(Stepper, "advance", broken)
    with pytest.raises(ZeroDivisionError):
        ff.simulate(read(BLOCK, tmp_path), tmp_path)
    left = Results.read(tmp_path)
    assert left.summary["stopped"].startswith("failed") and len(left.history) == 1


# ---------------------------------------------------------------------- nowhere to go
GROOVE = """
title = "A ring in a closed groove"
geometry = "axisymmetric"
[materials.metal]
flow_stress = { law = "constant", value = 100 }
[workpieces.ring]
shape = { kind = "rectangle", from = [20, 0], to = [30, 12] }
material = "metal"
mesh_size = 4
[tools.upper]
shape = { kind = "plane", point = [0, 12], normal = [0, -1] }
drive = { kind = "speed", velocity = [0, -1] }
[tools.lower]
shape = { kind = "plane", point = [0, 0], normal = [0, 1] }
[tools.inner]
shape = { kind = "plane", point = [18, 0], normal = [1, 0] }
[tools.outer]
shape = { kind = "plane", point = [32, 0], normal = [-1, 0] }
[steps]
stroke = 0.4
[stop]
stroke = 6
"""
FULL = 12 - 12 * (30**2 - 20**2) / (32**2 - 18**2)      # mm of stroke after which the ring fills the groove


def test_a_full_die_ends_the_run_where_it_is_full_and_says_so(tmp_path):
    """The penalty would go on, with a force that grows by itself and a volume that shrinks; steps of 0.4 mm are cut
    down to a thousandth, and what the force of landing points closes early is less than that of a side, 0.1 mm."""
    outcome = run(GROOVE, tmp_path)
    assert "the tools leave the body no room" in str(outcome.failure) and "stop.force" in str(outcome.failure)
    assert outcome.last["stroke_upper_mm"] == pytest.approx(FULL, abs=0.1)
    assert abs(outcome.last["volume_error_ring"]) < 5e-3
    area = np.pi * (32**2 - 18**2)
    assert np.max(outcome.results.history.column("force_upper_N")) < 12 * 100 * area, "it grows as the last gaps close"


def test_a_full_die_is_no_failure_of_a_press_that_has_a_limit(tmp_path):
    limit = 2e6      # N: nine times the flow stress on the whole face
    press = f"{{ kind = 'hydraulic', speed = 1, direction = [0, -1], force = {limit} }}"
    results = ff.simulate(ff.read_scene(scene_file(GROOVE, tmp_path), set=[f"tools.upper.drive={press}", "steps.stroke=1"]))
    assert "force limit" in results.summary["stopped"]
    assert results.history.rows[-1]["force_upper_N"] == pytest.approx(limit, rel=1e-3)
