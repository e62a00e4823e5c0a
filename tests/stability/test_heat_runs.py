"""A hot run on two ranks, resumed, remeshed and cut is the same run."""

from __future__ import annotations

import numpy as np
import pytest

from .scenes import DEMOS, run, swept
from .test_ranks import on_ranks, same
from .test_resume import goes_on, resumed

STEEL = """[materials.steel]
flow_stress = { law = "hensel_spittel", A = "1200 MPa", m1 = -0.0025, m2 = 0.02, m3 = 0.13, m4 = -0.02 }
density = "7500 kg/m^3"
conductivity = "28 W/m/K"
specific_heat = "650 J/kg/K"
plastic_heat_fraction = 0.9
"""

HOT = """
title = "Hot upsetting between a die of constant temperature and one of columns"
geometry = "axisymmetric"

""" + STEEL + """
[materials.die]
density = "7800 kg/m^3"
conductivity = "30 W/m/K"
specific_heat = "500 J/kg/K"

[workpieces.billet]
shape = { kind = "rectangle", from = [0, 0], to = [10, 20] }
material = "steel"
temperature = "1150 degC"
mesh_size = "3 mm"
air = { temperature = "20 degC", coefficient = "20 W/m^2/K", emissivity = 0.8 }

[tools.lower]
shape = { kind = "plane", point = [0, 0], normal = [0, 1] }
friction = { law = "siebel", factor = 0.4 }
heat_exchange = { kind = "constant", temperature = "250 degC", coefficient = "10000 W/m^2/K" }

[tools.upper]
shape = { kind = "plane", point = [0, 20], normal = [0, -1] }
drive = { kind = "speed", velocity = [0, "-100 mm/s"] }
friction = { law = "siebel", factor = 0.4 }
heat_exchange = { kind = "column", material = "die", temperature = "250 degC", coefficient = "10000 W/m^2/K" }

[points.rim]
body = "billet"
at = [10, 20]

[steps]
stroke = "0.5 mm"

[stop]
stroke = "4 mm"
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return run(HOT, tmp_path_factory.mktemp("whole")).results


def test_a_resumed_hot_run_goes_on_with_its_temperatures_columns_and_balance(whole, tmp_path):
    again = resumed(HOT, tmp_path, "stop.stroke='2 mm'")
    goes_on(whole, again)
    temperatures = [results.history.column("rim_temperature_degC") for results in (whole, again)]
    assert temperatures[1] == pytest.approx(temperatures[0], rel=1e-10)
    one, other = (results.summary["ledger"]["heat"]["sums_mJ"] for results in (whole, again))
    assert other == pytest.approx(one, rel=1e-9), "summed over both parts"


@pytest.mark.mpi
def test_two_ranks_find_the_temperatures_that_one_finds(whole, tmp_path):
    two = on_ranks(2, HOT, tmp_path)
    same(whole.history, two.history)


def test_every_step_balances_its_heat_and_nothing_is_hotter_than_work_can_make_it(whole):
    """1e-8 is asked for; what is left is rounding of the heat that the nodes hold."""
    assert np.abs(whole.history.column("heat_imbalance")).max() < 1e-8
    assert whole.history.column("min_temperature_degC").min() > 250
    heat = whole.summary["ledger"]["heat"]["sums_mJ"]
    assert heat["to_lower"] == pytest.approx(heat["to_upper"], rel=0.25), "a constant die takes more than one that warms up"
    assert heat["to_lower"] > heat["to_upper"]


def test_a_new_mesh_holds_the_heat_of_the_old_one(tmp_path):
    results = run(HOT, tmp_path, "workpieces.billet.remesh={ every = 2 }").results
    changes = [record["conservation"]["heat"] for record in results.summary["remeshed"]]
    assert len(changes) >= 3 and np.abs(changes).max() < 1e-10
    assert np.abs(results.history.column("heat_imbalance")).max() < 1e-8


BALL = """
geometry = "axisymmetric"

[materials.steel]
density = "7500 kg/m^3"
conductivity = "25 W/m/K"
specific_heat = "650 J/kg/K"

[workpieces.ball]
shape = { kind = "circle", centre = [0, 0], radius = 10 }
symmetry = ["z"]
material = "steel"
temperature = "1200 degC"
mesh_size = "2.5 mm"
air = { temperature = "20 degC", emissivity = 0.8 }

[points.skin]
body = "ball"
at = [10, 0]

[process]
flow = false

[steps]
time = "1 s"

[stop]
time = "8 s"
"""


@pytest.mark.mpi
def test_heat_alone_goes_on_after_a_break_on_two_ranks(tmp_path):
    whole = run(BALL, tmp_path / "whole").results
    run(BALL, tmp_path, "stop.time=4")
    again = on_ranks(2, BALL, tmp_path, resume=True)
    assert again.history.column("step").tolist() == whole.history.column("step").tolist()
    same(whole.history, again.history, within=1e-10)
    assert again.summary["stopped"] == "time 8 s reached" and again.summary["ranks"] == 2


COUPLED = ("tools.upper.shape={ kind = 'rectangle', from = [0, 20], to = [30, 40] }", "tools.upper.material='die'",
           "tools.upper.mesh_size={ contact = 1, far = 8 }",
           "tools.upper.heat_exchange={ kind = 'coupled', temperature = 250, coefficient = 10, every = 3 }",
           "workpieces.billet.remesh={ every = 3 }")


@pytest.mark.mpi
def test_a_die_with_a_temperature_field_goes_on_after_a_break_on_two_ranks_with_new_meshes_of_the_billet(tmp_path):
    whole = run(HOT, tmp_path / "whole", *COUPLED).results
    run(HOT, tmp_path, *COUPLED, "stop.stroke='2 mm'")
    again = on_ranks(2, HOT, tmp_path, *COUPLED, resume=True)
    same(whole.history, again.history)
    assert np.abs(whole.history.column("heat_imbalance")).max() < 1e-8
    assert 350 < whole.history.column("max_temperature_upper_degC")[-1] < 600
    assert (tmp_path / "heat_upper.pvd").exists() and "heat exchange upper: coupled" in whole.summary["parts_built"]


def test_columns_and_a_temperature_field_agree(whole, tmp_path):
    """Two per cent of the force, of the heat that the die takes and of its surface: what is asked for. With steps of its
    own that are twice as long, a quarter of the stroke, the die takes 3 % less."""
    for every, near in ((1, 0.02), (2, 0.04)):
        exchange = f"{{ kind = 'coupled', temperature = 250, coefficient = 10, every = {every} }}"
        field = run(HOT, tmp_path / str(every), *COUPLED[:2], "tools.upper.mesh_size={ contact = 0.25, far = 8 }",
                    f"tools.upper.heat_exchange={exchange}")
        for column in ("force_upper_N", "heat_to_upper_J", "max_temperature_upper_degC"):
            ours, columns = (results.history.column(column)[-1] for results in (field.results, whole))
            assert ours == pytest.approx(columns, rel=near), (column, every)


COOLING = "process.cooling=[{ time = 2 }, { at = 0.02, time = 3, on = ['lower'] }]"


def test_a_billet_cools_before_and_between_blows_while_the_press_waits(whole, tmp_path):
    """The clock goes on, the stroke does not; the billet is colder and harder; a break in between changes nothing."""
    cold = run(HOT, tmp_path / "whole", COOLING).results
    history, rows = cold.history, [row for row in cold.history.rows if row["dt_s"]]
    assert history.column("time_s")[-1] == pytest.approx(whole.history.column("time_s")[-1] + 5.0)
    assert history.column("stroke_upper_mm")[-1] == pytest.approx(4.0) and len(history) == len(whole.history) + 2
    waits = np.diff(history.column("time_s")) > 1
    assert np.diff(history.column("stroke_upper_mm"))[waits] == pytest.approx([0, 0], abs=1e-12)
    taken = np.diff(history.column("heat_to_lower_J"))[waits]
    assert taken[0] == 0 < taken[1], "in the air first, on the lower die then"
    assert rows[-1]["force_upper_N"] > 1.1 * whole.history.rows[-1]["force_upper_N"]
    goes_on(cold, resumed(HOT, tmp_path, "stop.stroke='2 mm'", COOLING))


def test_the_scene_of_hot_forging_runs_as_it_stands_to_its_dead_centre(tmp_path):
    """Crank, weight, Levanov's friction, a constant and a column die, air and radiation together; elements of 5 mm."""
    text = (DEMOS / "hot_forging.toml").read_text(encoding="utf-8")
    results = run(text, tmp_path, "workpieces.billet.mesh_size=5", "steps.stroke=2").results
    assert results.summary["stopped"] == "dead centre reached"
    last, built = results.history.rows[-1], results.summary["parts_built"]
    assert last["stroke_upper_mm"] == pytest.approx(25.0, abs=1e-6)
    exchange = {"heat exchange lower: constant", "heat exchange upper: column", "heat to radiation"}
    assert exchange | {"term weight"} <= set(built)
    assert 300 < last["max_temperature_upper_degC"] < 600 and last["max_temperature_degC"] > 1155
    assert np.abs(results.history.column("heat_imbalance")).max() < 1e-8


TWO = """
geometry = "axisymmetric"
process = { cooling = { time = 0.5 } }
""" + STEEL + """[workpieces.core]
shape = { kind = "rectangle", from = [0, 0], to = [6, 6] }
material = "steel"
symmetry = ["z"]
temperature = 1150
mesh_size = 1.6
[workpieces.sleeve]
shape = { kind = "rectangle", from = [6, 0], to = [10, 6] }
material = "steel"
symmetry = ["z"]
temperature = 800
mesh_size = 1.4
air = { temperature = 20, emissivity = 0.8 }
[[contacts]]
between = ["core", "sleeve"]
friction = { law = "siebel", factor = 0.3 }
conductance = "10000 W/m^2/K"
[tools.upper]
shape = { kind = "plane", point = [0, 6], normal = [0, -1] }
drive = { kind = "speed", velocity = [0, -50] }
friction = { law = "siebel", factor = 0.3 }
heat_exchange = { kind = "column", material = "steel", temperature = 200, coefficient = 10 }
[steps]
stroke = 0.2
[stop]
stroke = 1.6
"""


@pytest.mark.mpi
def test_heat_of_two_workpieces_goes_on_after_a_break_on_two_ranks(tmp_path):
    """The core warms the sleeve, before and while both are upset; alone it would have lost nothing to it."""
    whole = run(TWO, tmp_path / "whole").results
    run(TWO, tmp_path, "stop.stroke=0.8")
    again = on_ranks(2, TWO, tmp_path, resume=True)
    same(whole.history, again.history)
    heat = whole.history.column("heat_through_core_sleeve_J")
    assert (np.diff(heat) > 0).all() and np.abs(whole.history.column("heat_imbalance")).max() < 1e-8
    assert whole.history.column("min_temperature_core_degC")[-1] < 1100
    assert whole.history.column("max_temperature_sleeve_degC")[-1] > 850


@pytest.mark.mpi
def test_heat_alone_of_two_workpieces_goes_on_after_a_break_on_two_ranks(tmp_path):
    alone = ("process={ flow = false }", "steps={ time = 0.2 }", "stop={ time = 2 }")
    text = TWO[: TWO.index("[tools.upper]")].replace('process = { cooling = { time = 0.5 } }\n', "")
    whole = run(text, tmp_path / "whole", *alone).results
    run(text, tmp_path, *alone[:2], "stop={ time = 1 }")
    again = on_ranks(2, text, tmp_path, *alone, resume=True)
    same(whole.history, again.history, within=1e-10)
    assert whole.history.column("heat_through_core_sleeve_J")[-1] > 0


EXPANDING = """
geometry = "axisymmetric"
[materials.steel]
flow_stress = { law = "constant", value = 20 }
density = "7500 kg/m^3"
conductivity = "28 W/m/K"
specific_heat = "650 J/kg/K"
[materials.die]
density = "7800 kg/m^3"
conductivity = "30 W/m/K"
specific_heat = "500 J/kg/K"
young = "210 GPa"
poisson = 0.3
expansion = 1.2e-5
[workpieces.billet]
shape = { kind = "rectangle", from = [0, 0], to = [10, 10] }
symmetry = ["z"]
material = "steel"
temperature = 1150
mesh_size = 3
[tools.upper]
shape = { kind = "rectangle", from = [0, 10], to = [20, 30] }
material = "die"
mesh_size = { contact = 1.5, far = 6 }
held = { z_high = "z" }
drive = { kind = "speed", velocity = [0, -1] }
heat_exchange = { kind = "coupled", temperature = 250, coefficient = 10 }
[steps]
stroke = 0.05
[stop]
stroke = 0.6
"""
YIELDS = ("materials.die.yield_stress=100", "materials.die.hardening=2000")
IN_PARTS = ("tools.upper.parts={ core = { shape = { kind = 'rectangle', from = [0, 10], to = [12, 30] }, material = 'die', "
            "mesh_size = { contact = 1.5, far = 6 }, held = { z_high = 'z' } }, ring = { shape = { kind = 'rectangle', "
            "from = [12, 10], to = [20, 30] }, material = 'die', mesh_size = { contact = 3, far = 6 }, "
            "held = { z_high = 'z' } } }", "contacts=[{ between = ['core', 'ring'], interference = 0.01 }]")
KINDS = {"elastic": (), "yielding": YIELDS, "assembled": IN_PARTS, "separate": ("process.tool_deformation='separate'",),
         "coupled": ("process.tool_deformation='coupled'",)}


def expanding(kind):
    """The scene with a die of this kind."""
    if kind != "assembled":
        return EXPANDING
    return EXPANDING.replace('held = { z_high = "z" }\ndrive', "drive").replace(
        'material = "die"\nmesh_size = { contact = 1.5, far = 6 }\n', "").replace(
        "temperature = 250, c", "material = 'die', temperature = 250, c")


@pytest.mark.parametrize("kind", swept(["yielding"], [kind for kind in KINDS if kind != "yielding"]))
def test_a_die_that_expands_goes_on_after_a_break(kind, tmp_path):
    """Temperatures, expansion and stresses are those of the whole run, whatever the die is made of."""
    whole = run(expanding(kind), tmp_path / "whole", *KINDS[kind]).results
    again = resumed(expanding(kind), tmp_path, "stop.stroke=0.3", *KINDS[kind])
    same(whole.history, again.history)
    stressed(whole, again)


@pytest.mark.mpi
@pytest.mark.long
@pytest.mark.parametrize("kind", ["yielding", "assembled"])
def test_a_die_expands_alike_on_two_ranks(kind, tmp_path):
    one = run(expanding(kind), tmp_path / "one", *KINDS[kind], "stop.stroke=0.3").results
    two = on_ranks(2, expanding(kind), tmp_path / "two", *KINDS[kind], "stop.stroke=0.3")
    same(one.history, two.history)
    stressed(one, two)


def stressed(one, other):
    """The same stresses, beyond what contact alone makes: expansion that is held back."""
    for part, values in one.summary["tools"]["upper"].items():
        if isinstance(values, dict) and "largest_von_mises_MPa" in values:
            assert other.summary["tools"]["upper"][part]["largest_von_mises_MPa"] == \
                pytest.approx(values["largest_von_mises_MPa"], rel=1e-7) != pytest.approx(0, abs=100)


def test_new_meshes_of_two_workpieces_hold_the_heat_of_each(tmp_path):
    """The hot core is meshed anew, then the colder sleeve: neither gets what the other has."""
    once = run(TWO, tmp_path / "once", "stop.stroke=0.8").results
    more = run(TWO, tmp_path, "stop.stroke=0.8", "workpieces.core.remesh={ every = 2 }",
               "workpieces.sleeve.remesh={ every = 3 }").results
    changes = [record["conservation"]["heat"] for record in more.summary["remeshed"]]
    assert len(changes) >= 2 and np.abs(changes).max() < 1e-10
    assert np.abs(more.history.column("heat_imbalance")).max() < 1e-8
    for column in ("heat_through_core_sleeve_J", "force_upper_N", "min_temperature_core_degC"):
        assert more.history.column(column)[-1] == pytest.approx(once.history.column(column)[-1], rel=0.01), column
