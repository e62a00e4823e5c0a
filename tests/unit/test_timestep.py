"""The length of the next step: what is hit exactly, what cuts it, what lets it grow."""

import itertools

import numpy as np
import pytest

from fenics_forming import laws, scene
from fenics_forming.errors import ConvergenceError
from fenics_forming.process.body import FlowingBody
from fenics_forming.process.timestep import LANDING, Adaptivity, StepChoice
from fenics_forming.results.progress import Silent
from fenics_forming.simulation import simulate


def walk(choice, end, rates=lambda t: None, error=np.inf, most=1000):
    """Times, steps and reasons of a run to ``end`` on which every step succeeds."""
    time, times, steps, reasons = 0.0, [], [], []
    while time < end * (1 - 1e-12) and len(times) < most:
        limit = choice.next(time, rates(time))
        choice.succeeded(error, 10.0)
        time += limit.dt
        times.append(time)
        steps.append(limit.dt)
        reasons.append(limit.reason)
    return np.array(times), np.array(steps), reasons


def fail(choice):
    """The step from time 0 on fails; whether a shorter one is allowed."""
    return choice.failed(0.0, choice.next(0.0).dt)


def test_equal_steps_add_up_to_the_stop():
    """36 steps of 0.25 to 9: all the same, the last one too, none left over by rounding."""
    times, steps, reasons = walk(StepChoice(lambda t: 0.25, [9.0]), 9.0)
    assert len(times) == 36 and set(reasons) == {"step"}
    assert steps == pytest.approx(0.25, rel=1e-9) and times[-1] == 9.0
    # a tenth is no binary fraction: 100 of them do not add up to 10 by themselves
    times, steps, _ = walk(StepChoice(lambda t: 0.1, [10.0]), 10.0)
    assert len(times) == 100 and times[-1] == pytest.approx(10.0, abs=1e-14)


@pytest.mark.parametrize("adaptivity", [None, Adaptivity()])
def test_landmarks_are_hit_exactly(adaptivity):
    """Frames at given strokes and the stop, in any order, also closer together than a step."""
    landmarks = [1.0, 0.33, 0.34, 0.77, 1 / 3]
    times, steps, reasons = walk(StepChoice(lambda t: 0.1, landmarks, adaptivity), 1.0)
    for landmark in landmarks:
        assert np.abs(times - landmark).min() < 1e-15 * 4
    assert steps.max() <= 0.1 * (1 + 1e-9) and steps.min() > 1e-3
    assert "target" in reasons
    assert times[-1] == pytest.approx(1.0, abs=1e-15)


def test_step_before_a_landmark_is_halved_rather_than_leaving_a_sliver():
    """Adaptive steps: with 1.1 steps left it takes two of 0.55; equal steps keep their length."""
    adaptive, equal = (StepChoice(lambda t: 1.0, [1.1], a) for a in (Adaptivity(), None))
    assert adaptive.next(0.0).dt == pytest.approx(0.55)
    assert equal.next(0.0).dt == 1.0 and equal.next(1.0).dt == pytest.approx(0.1)


def test_cut_halves_and_success_doubles_up_to_the_wanted_step():
    choice = StepChoice(lambda t: 1.0)
    assert [fail(choice) and choice.next(0.0).dt for _ in range(3)] == [0.5, 0.25, 0.125]
    assert choice.next(0.0).reason == "cut"
    grown = []
    for _ in range(4):
        choice.succeeded(np.inf, 10.0)
        grown.append(choice.next(0.0).dt)
    assert grown == [0.25, 0.5, 1.0, 1.0]
    assert choice.next(0.0).reason == "step"


@pytest.mark.parametrize(("least", "cuts"), [(0.5, 1), (0.1, 3), (1e-3, 9)])
def test_step_shorter_than_the_least_fraction_fails(least, cuts):
    choice = StepChoice(lambda t: 7.0, min_fraction=least)
    allowed = 0
    while fail(choice):
        allowed += 1
        assert choice.next(0.0).dt >= 7.0 * least
    assert allowed == cuts


def test_wanted_step_may_change_with_time():
    """A stroke per step is a time per step that depends on the speed of the tool."""
    choice = StepChoice(lambda t: 0.1 + t)
    assert [choice.next(t).dt for t in (0.0, 1.0)] == pytest.approx([0.1, 1.1])


def test_adaptive_step_limits_the_strain_increment():
    """98 % of the nodes strain by no more than the limit; single nodes at corners may."""
    rates = np.full(100, 2.0)
    rates[-1] = 1e3
    limit = StepChoice(lambda t: 1.0, adaptivity=Adaptivity(max_strain_increment=0.05)).next(0.0, rates)
    assert limit.dt * 2.0 == pytest.approx(0.05, rel=1e-9) and limit.reason == "strain"
    slow = StepChoice(lambda t: 1.0, adaptivity=Adaptivity(max_strain_increment=0.05)).next(0.0, rates / 1e4)
    assert slow.dt == 1.0 and slow.reason == "step"
    assert StepChoice(lambda t: 1.0).next(0.0, 1e6 * rates).dt == 1.0, "equal steps do not look at the strain"


def test_strain_limit_does_not_go_below_the_least_fraction():
    limit = StepChoice(lambda t: 1.0, adaptivity=Adaptivity(), min_fraction=0.01).next(0.0, np.full(9, 1e9))
    assert limit.dt == pytest.approx(0.01)


def test_rest_does_not_limit_the_step():
    """No flow yet: all rates are zero."""
    assert StepChoice(lambda t: 1.0, adaptivity=Adaptivity()).next(0.0, np.zeros(5)).dt == 1.0


def test_error_control_finds_the_step_whose_error_is_the_tolerance():
    """The predictor's error is c dt²: from a step that is too long the choice settles near 0.9 of the ideal one."""
    tolerance, size, c = 1e-3, 10.0, 4.0
    choice = StepChoice(lambda t: 1.0, adaptivity=Adaptivity(tolerance=tolerance))
    taken = []
    for _ in range(12):
        dt = choice.next(0.0).dt
        taken.append(dt)
        choice.succeeded(c * dt**2, size)
    ideal = np.sqrt(tolerance * size / c)
    assert taken[0] == 1.0 and taken[1] == pytest.approx(0.3), "no more than to 0.3 at once"
    assert taken[-1] == pytest.approx(0.9 * ideal, rel=1e-3)
    assert choice.next(0.0).reason == "error"


def test_error_four_times_the_tolerance_halves_the_step_but_for_the_safety_factor():
    choice = StepChoice(lambda t: 1.0, adaptivity=Adaptivity(tolerance=1e-3))
    choice.succeeded(4e-3 * 10.0, 10.0)
    assert choice.next(0.0).dt == pytest.approx(0.45)


def test_small_error_lets_the_step_grow_by_half_at_most():
    choice = StepChoice(lambda t: 1.0, adaptivity=Adaptivity(tolerance=1e-3))
    for _ in range(4):
        fail(choice)
    grown = []
    for _ in range(8):
        choice.succeeded(1e-12, 10.0)
        grown.append(choice.next(0.0).dt)
    assert grown == pytest.approx(np.minimum(1.0, 1.5 ** np.arange(1, 9) / 16))


def test_cut_shortens_a_step_that_the_strain_had_limited_already():
    """A step that failed must not be tried again at the same length."""
    choice = StepChoice(lambda t: 1.0, adaptivity=Adaptivity(max_strain_increment=0.05))
    rates = np.full(10, 1.0)
    first = choice.next(0.0, rates).dt
    assert first == pytest.approx(0.05)
    assert choice.failed(0.0, first)
    assert choice.next(0.0, rates).dt == pytest.approx(first / 2)


# ---------------------------------------------------------------------- through a run
def upsetting():
    return scene.Scene(
        geometry="axisymmetric", materials={"m": scene.Material(flow_stress=laws.Constant(value=100))},
        workpieces={"billet": scene.Workpiece(shape=scene.Rectangle(from_=(0, 0), to=(10, 10)), material="m",
                                              symmetry=["z"], mesh_size=5)},
        tools={"upper": scene.Tool(shape=scene.Plane(point=(0, 10), normal=(0, -1)),
                                   drive=laws.SpeedDrive(velocity=(0, -1)))},
        steps=scene.Steps(stroke=0.5), stop=scene.Stop(stroke=1.0))


class Notes(Silent):
    def __init__(self):
        self.notes = []

    def note(self, text):
        self.notes.append(text)


def fail_when(monkeypatch, bad):
    """Every solve for which ``bad(time, number)`` holds does not converge."""
    numbers, solve = itertools.count(), FlowingBody.solve

    def failing(self, time, *args, **more):
        if bad(time, next(numbers)):
            self.x[:] *= 1.01       # what a failed step leaves behind must not be seen
            raise ConvergenceError("no convergence, on purpose")
        return solve(self, time, *args, **more)

    monkeypatch.setattr(FlowingBody, "solve", failing)


def test_failed_step_is_cut_taken_back_and_said(monkeypatch):
    """The run goes on from the last good state with half the step, ends at the same stop, and keeps its volume."""
    whole = simulate(upsetting())
    fail_when(monkeypatch, lambda time, number: number == 1)
    notes = Notes()
    results = simulate(upsetting(), observer=notes)
    assert len(notes.notes) == 1 and notes.notes[0].startswith("step 1 cut: no convergence")
    assert results.history.column("stroke_upper_mm") == pytest.approx([0, 0.25, 0.75, 1.0])
    end, uncut = (r.history.column("volume_billet_mm3")[-1] for r in (results, whole))
    assert end == pytest.approx(uncut, rel=1e-3)     # the drift of the midpoint scheme


def test_run_that_fails_however_short_the_step_says_so(monkeypatch):
    fail_when(monkeypatch, lambda time, number: time > 0.6)
    with pytest.raises(ConvergenceError, match="step .* fails however short it is: no convergence"):
        simulate(upsetting())


def test_landing_points_shorten_the_next_step_in_proportion_to_the_power_they_take():
    choice = StepChoice(lambda t: 1.0, adaptivity=Adaptivity(landing=0.01))
    choice.succeeded(np.inf, 10.0, landing=0.02)
    shorter = choice.next(0.0)
    assert shorter.dt == pytest.approx(0.45) and shorter.reason == "contact"      # 0.9 · 0.01 / 0.02
    for _ in range(20):
        choice.succeeded(np.inf, 10.0, landing=0.5)
    assert choice.next(0.0).dt == pytest.approx(LANDING)                          # a strip runs into rolls without end
    equal = StepChoice(lambda t: 1.0)
    equal.succeeded(np.inf, 10.0, landing=0.5)
    assert equal.next(0.0).dt == 1.0                                              # equal steps stay equal
