"""Columns under a die on a press frame that yields: REFERENCES.md 10.1 to 10.3 in all modes of coupling."""

from __future__ import annotations

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.errors import ConvergenceError
from fenics_forming.simulation.run import Simulation

SCENE = """
geometry = "axisymmetric"
[materials.metal]
flow_stress = {law}
[workpieces.column]
shape = {{ kind = "rectangle", from = [0, 0], to = [10, 20] }}
material = "metal"
mesh_size = "5 mm"
[tools.upper]
shape = {{ kind = "plane", point = [0, 20], normal = [0, -1] }}
drive = {{ kind = "speed", velocity = [0, "-1 mm/s"], stiffness = "200 kN/mm" }}
[tools.lower]
shape = {{ kind = "plane", point = [0, 0], normal = [0, 1] }}
[process]
volume_constancy = "each_step"
{process}
[steps]
stroke = {stroke}
scheme = "{scheme}"
tool_every = {every}
[stop]
stroke = "{stop} mm"
[solver]
penalty_factor = 1000.0
"""
PERFECT, POWER = '{ law = "constant", value = "100 MPa" }', '{ law = "norton_hoff", K = "100 MPa", m = 0.1 }'
HEIGHT = {PERFECT: 10.304865, POWER: 10.242435}
# what is left for small steps: the penetration of the penalty, in all modes alike
LEFT = 6e-4


def column(folder, steps, mode="iterated", *, law=PERFECT, every=1, guard=True, scheme="implicit", stop=10.0, out=None):
    """A column after a travel of 10 mm in equal steps; the run and what it said."""
    process = f'tool_deformation = "{mode}"' + ("" if guard else "\ntool_guard = false")
    path = folder / "column.toml"
    path.write_text(SCENE.format(law=law, process=process, stroke=10 / steps, every=every, scheme=scheme, stop=stop))
    run, heard = Simulation(ff.read_scene(path)), Heard()
    run.run(out, observer=heard)
    return run, heard


class Heard:
    """Keeps what a run says."""

    def __init__(self):
        self.notes, self.rows = [], []

    def started(self, words):
        pass

    def step(self, row, limited_by):
        self.rows.append(dict(row))

    def note(self, sentence):
        self.notes.append(sentence)

    def finished(self, results):
        pass


def error(run, law=PERFECT) -> float:
    return run.body.height() - HEIGHT[law]


def test_stress_only_leaves_the_deflection_out(tmp_path, verified):
    """The height is that of rigid tools; what it misses is F/K of that height, 0.314159 mm: -3.049e-1 in 10.1."""
    run, heard = column(tmp_path, 20, "stress_only")
    verified("10.1", "error of the height, stress only, 20 steps", error(run), -0.304865, within=LEFT, unit="mm",
             absolute=True)
    assert heard.rows[-1]["deflection_upper_mm"] == pytest.approx(0.314159, rel=1e-3)
    assert any("stress_only" in note for note in heard.notes)


@pytest.mark.parametrize("law", [PERFECT, POWER], ids=["perfect", "power law"])
def test_iterated_is_limited_by_the_integration_of_the_workpiece_alone(law, tmp_path, verified):
    """Second order in every scheme, by which the height follows the travel of the tool exactly: what is left is the force
    on the geometry of the solve, and that is extrapolated."""
    errors = [error(column(tmp_path, n, law=law)[0], law) for n in (10, 20)]
    assert abs(errors[0]) < 4e-3
    entry, of = ("10.1", "perfect") if law == PERFECT else ("10.3", "power law")
    verified(entry, f"error of the height, iterated, 20 steps, {of}", errors[1], 0.0, within=2 * LEFT, unit="mm",
             absolute=True)
    first, second = (error(column(tmp_path, n, law=law, scheme="explicit")[0], law) for n in (20, 40))
    assert abs(first) < 2e-3 and first / second > 3.2


@pytest.mark.parametrize("scheme", ["etd2", "implicit"])
def test_the_force_of_small_steps_does_not_ring(scheme, tmp_path):
    """Steps of 0.03 mm, a fifth of 6 m u = 0.14 mm below which a scheme that extrapolates from earlier solves alone
    rings: the force rises with every step, by what it did in the one before to a thousandth of itself."""
    run, heard = column(tmp_path, 320, law=POWER, scheme=scheme, stop=2.0)
    force = np.array([row["force_upper_N"] for row in heard.rows])[10:]
    assert (np.diff(force) > 0).all() and np.abs(np.diff(force, 2)).max() < 1e-3 * force[-1]


@pytest.mark.long
def test_separate_makes_volume_in_proportion_to_its_steps(tmp_path):
    """What a tool step moves the contact nodes by is volume: first order, and four times as much where the tool is solved
    every fourth step (10.1: the errors of the height behave so)."""
    made, heights = {}, {}
    for steps, every in ((20, 1), (40, 1), (80, 1), (80, 4)):
        run, _ = column(tmp_path, steps, "separate", every=every)
        made[steps, every] = run.body.workpiece.volume() / run.start_volume - 1
        heights[steps, every] = error(run)
        assert run.volume_ledger.by()["tools"] > made[steps, every]
    assert made[20, 1] / made[40, 1] == pytest.approx(2.0, rel=0.05)
    assert made[80, 4] / made[80, 1] == pytest.approx(4.0, rel=0.05)
    assert abs(heights[80, 1]) < 3.453e-3 / 2 and abs(heights[80, 4]) < 3.172e-3 / 2        # the values of 10.1


@pytest.mark.parametrize("law, bounds", [(PERFECT, {(20, 1): 2.578e-2, (20, 4): 5.765e-2, (40, 4): 3.162e-2}),
                                         (POWER, {(20, 1): 2.26e-2, (20, 4): 5.01e-2})], ids=["perfect", "power law"])
def test_coupled_follows_with_the_lag_of_its_tool_steps(law, bounds, tmp_path):
    """Not farther off than the schemes of 10.1 and 10.3 with the same tool steps; longer tool steps are less exact."""
    errors = {key: abs(error(column(tmp_path, key[0], "coupled", every=key[1], law=law)[0], law)) for key in bounds}
    for key, bound in bounds.items():
        assert errors[key] < bound, key
    assert errors[20, 4] > 4 * errors[20, 1]


@pytest.mark.long
@pytest.mark.parametrize("law", [PERFECT, POWER], ids=["perfect", "power law"])
def test_the_error_of_coupled_goes_down_by_order_one_at_least(law, tmp_path, verified):
    """10.1 and 10.3, the tool solved in every fourth step: half the steps, half the error or less (order one as listed;
    ours goes to two, since the guard takes the first contact, where the lag is largest, inside the solve)."""
    errors = [abs(error(column(tmp_path, steps, "coupled", every=4, law=law)[0], law)) for steps in (20, 40, 80)]
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    where = "10.1" if law is PERFECT else "10.3"
    verified(where, "order of coupled, tool every fourth step", order.min(), 1.5, within=0.55, absolute=True)
    assert (order > 1.0).all() and (order < 2.1).all()
    single = abs(error(column(tmp_path, 40, "coupled", law=law)[0], law))
    assert errors[1] > 4 * single, "four times the lag, four times the error at least"


@pytest.mark.parametrize("law, steps", [(POWER, 80), (PERFECT, 40)], ids=["by its rate", "by opening"])
def test_coupled_blows_up_below_its_limits_and_the_guard_prevents_it(law, steps, tmp_path):
    """m = 0.1, deflection 0.16 to 0.24 mm: 6 m u = 0.1 to 0.14 mm, the travel is 0.125 mm. Perfect plasticity: at first
    contact the deflection jumps by 0.157 mm, of which twice is more than the travel of 0.25 mm (notes/coupling.md 3)."""
    with pytest.raises(ConvergenceError):
        run, _ = column(tmp_path, steps, "coupled", guard=False, law=law)
        if abs(error(run, law)) > 0.02:
            raise ConvergenceError("it rang")
    run, heard = column(tmp_path, steps, "coupled", law=law)
    assert abs(error(run, law)) < 2e-3
    forces = np.array([row["force_upper_N"] for row in heard.rows])
    assert (forces[5:] > 0.9 * np.maximum.accumulate(forces)[5:]).all()         # it never lets go


def test_coupled_starts_iterated_and_says_when_it_changes(tmp_path):
    run, heard = column(tmp_path, 40, "coupled", every=4)
    assert any("coupled from here on" in note for note in heard.notes)
    numbers = np.array([row["stability_upper"] for row in heard.rows])
    assert numbers[-1] == pytest.approx(61, rel=0.1)        # travel 1 mm over 2 m u; m is what ties the solves together


@pytest.mark.long
def test_tool_steps_by_time_and_by_deflection(tmp_path):
    """tool_step = { time } of four steps is tool_every = 4; by deflection the tool is solved as often as the force asks."""
    path = tmp_path / "column.toml"
    mode = 'tool_deformation = "coupled"'
    text = SCENE.format(law=PERFECT, process=mode, stroke=0.25, every=4, scheme="implicit", stop=5.0)
    found = []
    for step in ("tool_every = 4", 'tool_step = { time = "1 s" }', 'tool_step = { deflection = "0.002 mm" }'):
        path.write_text(text.replace("tool_every = 4", step))
        run = Simulation(ff.read_scene(path))
        results = run.run()
        found.append((run.body.height(), results.history.column("deflection_upper_mm")))
    assert found[0][0] == pytest.approx(found[1][0], rel=1e-12)
    changes = [np.count_nonzero(np.diff(deflections)) for _, deflections in found]
    assert changes[2] > changes[0]


@pytest.mark.parametrize("mode", ["stress_only", "separate", "coupled", "iterated"])
def test_a_run_that_was_interrupted_goes_on_as_if_it_had_not_been(mode, tmp_path):
    """To 1e-10 in every column, in the middle of a tool step."""
    whole, _ = column(tmp_path, 20, mode, every=4, stop=5.0)
    column(tmp_path, 20, mode, every=4, stop=3.0, out=tmp_path / "out")
    (tmp_path / "column.toml").write_text((tmp_path / "column.toml").read_text().replace('"3.0 mm"', '"5.0 mm"'))
    resumed = Simulation(ff.read_scene(tmp_path / "column.toml"), resume=tmp_path / "out" / "checkpoint.npz")
    results = resumed.run(tmp_path / "out")
    expected = whole._recorder.history
    assert len(results.history) == len(expected)
    for name in expected.columns:
        if name not in ("wall_s", "power_imbalance"):
            a, b = expected.column(name), results.history.column(name)
            assert np.abs(a - b).max() <= 1e-10 * max(1.0, np.abs(a).max()), name


def test_a_viscous_column_follows_the_force_of_a_damper_on_a_spring(tmp_path, verified):
    """REFERENCES.md 10.2: F = cV (1 - exp(-Kt/c)). A Newtonian column has c = K_n A / h, constant up to the change of its
    height; with K_n so large that 1 mm of travel deforms it little, the first tenth of a second shows the exponential."""
    viscosity = 1e5 * 20 / (np.pi * 100)      # c = 1e5 N s/mm at the start
    law = f'{{ law = "norton_hoff", K = "{viscosity} MPa", m = 1.0 }}'
    for steps, bound in ((100, 8e-2), (200, 4e-2)):
        run, heard = column(tmp_path, steps, law=law, stop=1.0)
        time, force = (np.array([row[name] for row in heard.rows]) for name in ("time_s", "force_upper_N"))
        exact = 1e5 * (1 - np.exp(-2 * time))
        assert np.abs(force - exact)[1:].max() < bound * 1e5
    half = int(np.argmin(np.abs(time - 0.5)))
    verified("10.2", "force after 0.5 s in steps of 5 ms", force[half], 63212.056, within=0.01, unit="N")
    # with the height that the column has by then, c = 1e5 (20/h)^2, the rest of the error is of second order
    u, t = 0.0, 0.0
    while t < 1 - 1e-9:
        u += 1e-4 * (1 - 2 * u * ((20 - t + u) / 20) ** 2)
        t += 1e-4
    assert force[-1] == pytest.approx(2e5 * u, rel=3e-3)
