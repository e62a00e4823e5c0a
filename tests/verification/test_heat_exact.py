"""Heat against exact solutions (REFERENCES.md 9), all within the 0.5 % that is asked for."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_forming import simulate
from fenics_forming.laws.heat_exchange import Air, ColumnExchange
from fenics_forming.physics import meshing
from fenics_forming.physics.contact.facets import ContactFacets
from fenics_forming.physics.contact.rigid import KnownTool, ToolMotion
from fenics_forming.physics.contact.surfaces import Plane
from fenics_forming.physics.kinematics import KINDS
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.thermal import columns
from fenics_forming.physics.thermal.field import HeatField
from fenics_forming.process.heat.heating import BodyHeat, ToolExchange
from fenics_forming.scene import Scene

STEEL, DIE = (25.0, 7500e-12 * 650e6), (30.0, 7800e-12 * 500e6)     # conductivity, heat capacity of the volume
GRADED = np.concatenate([[0.0], np.cumsum(1.15 ** np.arange(40))])


def strip(length, kinematics="plane_strain", places=None, material=STEEL, **more):
    """Heat of a strip along x, or of a disk along r, that exchanges at its end x = 0 or, with `far`, at x = length."""
    far, places = more.pop("far", True), np.linspace(0, 1, 21) if places is None else places / places[-1]
    mesh = meshing.rectangle((0, 0), (length, 1), (len(places) - 1, 1))
    x = mesh.geometry.x
    x[:, 0] = np.interp(x[:, 0] / length * (len(places) - 1), np.arange(len(places)), places * length)
    nodes, kin = Nodes(mesh), KINDS[kinematics]
    facets = meshing.boundary_facets(mesh, lambda x: np.isclose(x[0], length if far else 0.0))
    field = HeatField(nodes, kin, conductivity=material[0], volumetric_capacity=material[1])
    return BodyHeat(field, ContactFacets(nodes, kin, facets), effusivity=float(np.sqrt(material[0] * material[1])),
                    exchanges=more.pop("exchanges", {}), **more)


def after(body, start, *stages, tools=()):
    """Nodal temperatures and state after stages of (step s, number), and the largest imbalance on the way."""
    history, state, worst = {"temperature": np.full(body.field.nodes.count, start)}, body.first(), 0.0
    for dt, number in stages:
        for _ in range(number):
            history, state = body.advance(history, history, state, list(tools), dt)
            worst = max(worst, abs(state.imbalance))
    return history["temperature"], state, worst


def at(body, temperature, x):
    here = np.isclose(body.field.nodes.x[:, 0], x)
    return temperature[here].mean()


@pytest.mark.parametrize(("biot", "fourier", "centre", "surface", "mean"), [
    (1, 0.2, 0.950642, 0.643391, 0.851595), (1, 1.0, 0.533859, 0.348177, 0.470397),
    (0.1, 1.0, 0.922389, 0.878126, 0.907587), (10, 0.5, 0.454641, 0.064329, 0.315016)])
def test_a_slab_cools_as_heisler_has_it(biot, fourier, centre, surface, mean, verified):
    """REFERENCES.md 9.3; of the first temperature difference, 1."""
    length, (conductivity, capacity) = 10.0, STEEL
    body = strip(length, air=Air(temperature=0, coefficient=biot * conductivity / length))
    end, steps = fourier * length**2 * capacity / conductivity, 400
    found, _, worst = after(body, 1.0, (end / steps, steps))
    verified("9.3", f"slab, Bi = {biot:g}, Fo = {fourier:g}", (at(body, found, 0), at(body, found, length),
             body.field.mean(found)), (centre, surface, mean), within=5e-3, at=("centre", "surface", "mean"))
    assert worst < 1e-8


@pytest.mark.parametrize(("fourier", "centre", "surface"), [(0.2, 0.870174, 0.570228), (1.0, 0.249380, 0.160338)])
def test_a_cylinder_cools_as_heisler_has_it(fourier, centre, surface, verified):
    """REFERENCES.md 9.3, Bi = 1: the weights 2 pi r, and the axis where they vanish."""
    length, (conductivity, capacity) = 10.0, STEEL
    body = strip(length, "axisymmetric", air=Air(temperature=0, coefficient=conductivity / length))
    end, steps = fourier * length**2 * capacity / conductivity, 400
    found, _, worst = after(body, 1.0, (end / steps, steps))
    verified("9.3", f"cylinder, Bi = 1, Fo = {fourier:g}", (at(body, found, 0), at(body, found, length)),
             (centre, surface), within=5e-3, at=("centre", "surface"))
    assert worst < 1e-8


STAGES = ((0.0005, 20), (0.0025, 36), (0.02, 245), (0.05, 100))
HALF_SPACES = {0.1: (990.866, 413.447, 5774.184), 10.0: (752.653, 656.571, 960.8187)}   # of steel, of the die, mW/mm²


@pytest.mark.parametrize("time", HALF_SPACES)
def test_a_half_space_on_columns_is_two_half_spaces(time, verified):
    """REFERENCES.md 9.1: surfaces and flux within 0.5 %, at 5 mm depth too."""
    law = ColumnExchange(temperature=200.0, coefficient=10.0)
    body = strip(120.0, places=GRADED, far=False, exchanges={"die": ToolExchange(law, float(np.sqrt(DIE[0] * DIE[1])))})
    tool = KnownTool("die", Plane((0, 0), (1, 0)), None, ToolMotion(np.zeros(2), np.zeros(2)))
    stages = STAGES[:2] if time == 0.1 else STAGES
    found, state, worst = after(body, 1200.0, *stages, tools=[tool])
    ours = at(body, found, 0)
    flux = state.lost["die"] / stages[-1][0]
    steel, die, reference = HALF_SPACES[time]
    verified("9.1", f"columns after {time:g} s", (ours, ours - flux / law.coefficient), (steel, die), within=5e-3,
             unit="degC", at=("steel", "die"))
    verified("9.1", f"columns after {time:g} s, flux", flux, reference, within=5e-3, unit="mW/mm²")
    if time == 10.0:
        x = body.field.nodes.x[:, 0]
        order = np.argsort(x)
        verified("9.1", "columns after 10 s, steel at 5 mm", np.interp(5.0, x[order], found[order]), 932.177,
                 within=2e-3, unit="degC")
    assert worst < 1e-8


def test_columns_know_times_from_microseconds_to_hours():
    """A steady flux, 2 √(t/π) of rise, in one step or in many: within 1e-4 over nine decades."""
    for time in np.geomspace(1e-5, 1e4, 19):
        assert columns.resistance(time) == pytest.approx(2 * np.sqrt(time / np.pi), rel=1.2e-4)
    modes, steps, time = columns.at_rest(1), 64, 1.0
    for _ in range(steps - 1):
        modes = columns.advanced(modes, np.ones(1), time / steps)
    rise = columns.rise(modes, time / steps) + columns.resistance(time / steps)
    assert rise[0] == pytest.approx(2 * np.sqrt(time / np.pi), rel=1.2e-4)


def test_friction_heat_warms_a_half_space_and_a_column_alike(verified):
    """REFERENCES.md 9.5: half of 5 W/mm² for 1 s, 255.5276 K; the same flux into a column of steel."""
    body, seconds, flux = strip(60.0, places=GRADED, far=False), 1.0, 2.5e3     # mW/mm²
    area = body.field.surface_sum(body.facets, body.facets.weights())
    steps = 200
    made = {"temperature": np.zeros(body.field.nodes.count)}
    state = body.first()
    for _ in range(steps):
        gathered = made | {"plastic": body.field.heating(flux * area) * seconds / steps}
        made, state = body.advance(made, gathered, state, [], seconds / steps)
    verified("9.5", "half of the friction heat, surface after 1 s", at(body, made["temperature"], 0), 255.5276,
             within=5e-3, unit="K")
    effusivity = np.sqrt(STEEL[0] * STEEL[1])
    assert flux * columns.resistance(seconds) / effusivity == pytest.approx(255.5276, rel=5e-4)


def test_friction_heat_is_split_by_effusivities(verified):
    """REFERENCES.md 9.5: e1 / (e1 + e2) = 0.505103 for the two steels of 9.1."""
    one, other = (float(np.sqrt(k * c)) for k, c in (STEEL, DIE))
    exchange = ToolExchange(ColumnExchange(temperature=20, coefficient=1), other)
    verified("9.5", "share of the steel in the friction heat", exchange.share(one), 0.505103, within=2e-6)


BALL = {"geometry": "axisymmetric", "materials": {"steel": {"density": "7500 kg/m^3", "conductivity": "25000 W/m/K",
                                                            "specific_heat": "650 J/kg/K"}},
        "workpieces": {"ball": {"shape": {"kind": "circle", "centre": [0, 0], "radius": 10}, "symmetry": ["z"],
                                "material": "steel", "temperature": "1200 degC", "mesh_size": 2.5}},
        "process": {"flow": False}, "steps": {"time": 0.25}, "stop": {"time": 10}}


def ball(air, stop=10.0, step=0.25):
    """A ball that conducts so well that it is equally hot everywhere; a scene of heat alone."""
    scene = {**BALL, "steps": {"time": step}, "stop": {"time": stop}}
    scene["workpieces"] = {"ball": {**BALL["workpieces"]["ball"], "air": air}}
    return simulate(Scene.read(scene))


def test_a_ball_radiates_as_stefan_and_boltzmann_have_it(verified):
    """REFERENCES.md 9.4: 1361.3209 K after 10 s."""
    history = ball({"temperature": "20 degC", "emissivity": 0.8}).history
    verified("9.4", "radiating ball after 10 s", history.column("mean_temperature_degC")[-1] + 273.15, 1361.3209,
             within=2e-3, unit="K")
    assert np.abs(history.column("heat_imbalance")).max() < 1e-8


def test_a_ball_in_still_air_cools_exponentially(verified):
    """REFERENCES.md 9.4: of the temperature difference 0.928815 is left after 60 s at 20 W/m²K."""
    history = ball({"temperature": "20 degC", "coefficient": "20 W/m^2/K"}, stop=60.0, step=2.0).history
    left = (history.column("mean_temperature_degC")[-1] - 20) / 1180
    verified("9.4", "ball in still air, left after 60 s", left, 0.928815, within=1e-3)


def test_a_run_of_heat_alone_builds_no_velocities(monkeypatch):
    from fenics_forming.physics import workpiece

    monkeypatch.setattr(workpiece.Workpiece, "__init__", lambda *a, **k: pytest.fail("a space of velocities was built"))
    results = ball({"temperature": 20, "emissivity": 0.8}, stop=1.0, step=0.5)
    assert results.summary["parts_built"] == ["heat conduction", "heat to radiation"]
    assert not any("force" in column or "strain" in column for column in results.history.columns)


def two_bars(time, steps, size):
    """A hot bar of steel against a die, side by side along x, insulated elsewhere; a scene of heat alone."""
    material = lambda k, c, d: {"conductivity": f"{k} W/m/K", "specific_heat": f"{c} J/kg/K", "density": f"{d} kg/m^3"}  # noqa: E731
    length, high = 12 * np.sqrt(8 * time), 3 * size
    return Scene.read({
        "geometry": "plane_strain", "materials": {"steel": material(25, 650, 7500), "die": material(30, 500, 7800)},
        "workpieces": {"bar": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [length, high]}, "material": "steel",
                               "temperature": 1200, "mesh_size": 12 * size,
                               "refine": [{"kind": "near_tool", "tool": "die", "distance": size, "size": size}]}},
        "tools": {"die": {"shape": {"kind": "rectangle", "from": [-length, 0], "to": [0, high]}, "material": "die",
                          "mesh_size": {"contact": size, "far": 12 * size},
                          "heat_exchange": {"kind": "coupled", "temperature": 200, "coefficient": "10000 W/m^2/K"}}},
        "points": {"face": {"body": "bar", "at": [0, high / 2]}},
        "process": {"flow": False}, "steps": {"time": time / steps}, "stop": {"time": time}})


@pytest.mark.parametrize(("time", "steps", "size"), [(0.1, 80, 0.05), (10.0, 200, 0.4)])
def test_a_bar_on_a_die_with_a_temperature_field_is_two_half_spaces(time, steps, size, verified):
    """REFERENCES.md 9.1: both surfaces and the flux within 0.5 %; what the bar loses the die has."""
    history = simulate(two_bars(time, steps, size)).history
    steel, die, flux = HALF_SPACES[time]
    last = history.rows[-1]
    verified("9.1", f"temperature field after {time:g} s", (last["face_temperature_degC"],
             last["max_temperature_die_degC"]), (steel, die), within=5e-3, unit="degC", at=("steel", "die"))
    lost = np.diff(history.column("heat_to_die_J_per_mm"))[-1] * 1000 / (time / steps) / (3 * size)
    verified("9.1", f"temperature field after {time:g} s, flux", lost, flux, within=5e-3, unit="mW/mm²")
    assert np.abs(history.column("heat_imbalance")).max() < 1e-8


def test_a_die_that_conducts_in_every_fifth_step_takes_the_same_heat():
    """In between its surface answers as columns do: within 4 % of conduction in every step, at the end of any step. (A
    surface that keeps what it gets until then would be as hot as the plate, and take half.)"""
    def heat(every):
        history = simulate(Scene.read({
            "geometry": "plane_strain",
            "materials": {"copper": {"conductivity": "390 W/m/K", "density": "8960 kg/m^3", "specific_heat": "385 J/kg/K"},
                          "steel": {"conductivity": "45 W/m/K", "density": "7850 kg/m^3", "specific_heat": "470 J/kg/K"}},
            "workpieces": {"plate": {"shape": {"kind": "rectangle", "from": [0, -2], "to": [30, 2]}, "material": "copper",
                                     "temperature": "500 degF", "mesh_size": 2}},
            "tools": {"low": {"shape": {"kind": "rectangle", "from": [5, -32], "to": [25, -2]},
                              "heat_exchange": {"kind": "coupled", "material": "steel", "temperature": 20,
                                                "coefficient": "3000 W/m^2/K", "every": every}}},
            "process": {"flow": False}, "steps": {"time": 0.1}, "stop": {"time": 2}})).history
        assert np.abs(history.column("heat_imbalance")).max() < 1e-8
        return history.column("heat_to_low_J_per_mm")[1:]
    often, seldom = heat(1), heat(5)
    np.testing.assert_allclose(seldom, often, rtol=0.04)
