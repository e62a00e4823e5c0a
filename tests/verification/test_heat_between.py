"""Heat of several workpieces: through their common surface, made by friction there, and into air and tools."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_forming import simulate
from fenics_forming.scene import Scene

STEEL = {"conductivity": "25 W/m/K", "specific_heat": "650 J/kg/K", "density": "7500 kg/m^3"}
DIE = {"conductivity": "30 W/m/K", "specific_heat": "500 J/kg/K", "density": "7800 kg/m^3"}
HALF_SPACES = {0.1: (990.866, 413.447, 5774.184), 10.0: (752.653, 656.571, 960.8187)}


def two_bars(time, steps, size, named=("hot", "cold")):
    """A hot bar of steel against a cold one, side by side along x, insulated elsewhere; a scene of heat alone."""
    length, high = 12 * np.sqrt(8 * time), 3 * size
    near = [{"kind": "box", "from": [-2 * size, -1], "to": [2 * size, high + 1], "size": size}]
    bar = lambda material, low, temperature: {  # noqa: E731
        "shape": {"kind": "rectangle", "from": [low, 0], "to": [low + length, high]}, "material": material,
        "temperature": temperature, "mesh_size": 12 * size, "refine": near}
    return Scene.read({
        "geometry": "plane_strain", "materials": {"steel": STEEL, "die": DIE}, "process": {"flow": False},
        "workpieces": {"hot": bar("steel", 0, 1200), "cold": bar("die", -length, 200)},
        "contacts": [{"between": list(named), "conductance": "10000 W/m^2/K"}],
        "points": {"face": {"body": "hot", "at": [0, high / 2]}, "other": {"body": "cold", "at": [0, high / 2]}},
        "steps": {"time": time / steps}, "stop": {"time": time}})


@pytest.mark.parametrize(("time", "steps", "size"), [(0.1, 80, 0.04), (10.0, 250, 0.3)])
def test_two_workpieces_that_touch_are_two_half_spaces(time, steps, size, verified):
    """REFERENCES.md 9.1, within 0.5 %: both faces, at one place, each with that of its own body; and the flux."""
    history = simulate(two_bars(time, steps, size)).history
    steel, die, flux = HALF_SPACES[time]
    last = history.rows[-1]
    verified("9.1", f"two workpieces after {time:g} s", (last["face_temperature_degC"], last["other_temperature_degC"]),
             (steel, die), within=5e-3, unit="degC", at=("steel", "die"))
    through = np.diff(history.column("heat_through_hot_cold_J_per_mm"))[-1] * 1000 / (time / steps) / (3 * size)
    verified("9.1", f"two workpieces after {time:g} s, flux", through, flux, within=5e-3, unit="mW/mm²")
    assert np.abs(history.column("heat_imbalance")).max() < 1e-8


def test_heat_counts_from_the_body_that_is_named_first():
    there, back = (simulate(two_bars(0.1, 10, 0.1, named)).history for named in (("hot", "cold"), ("cold", "hot")))
    there, back = there.rows[-1]["heat_through_hot_cold_J_per_mm"], back.rows[-1]["heat_through_cold_hot_J_per_mm"]
    assert there > 0 and back == pytest.approx(-there, rel=1e-12)


def bimetal(**changes):
    """A hot core in a colder sleeve, upset together; the core is narrower, so both rub on one another and on the tool."""
    hot = {"flow_stress": {"law": "constant", "value": 100}, **STEEL, "plastic_heat_fraction": 0.9}
    body = lambda low, high, temperature, **more: {  # noqa: E731
        "shape": {"kind": "rectangle", "from": [low, 0], "to": [high, 6]}, "material": "steel", "symmetry": ["z"],
        "mesh_size": 1.5, "temperature": temperature, **more}
    scene = {
        "geometry": "axisymmetric",
        "materials": {"steel": hot, "other": {**hot, "flow_stress": {"law": "constant", "value": 60}}},
        "workpieces": {"core": body(0, 6, 1000), "sleeve": body(6, 10, 400, air={"temperature": 20, "emissivity": 0.8})},
        "contacts": [{"between": ["core", "sleeve"], "friction": {"law": "siebel", "factor": 0.3},
                      "conductance": "20000 W/m^2/K"}],
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 6], "normal": [0, -1]},
                            "drive": {"kind": "speed", "velocity": [0, -20]}, "friction": {"law": "siebel", "factor": 0.2},
                            "heat_exchange": {"kind": "constant", "temperature": 200, "coefficient": 5}}},
        "steps": {"stroke": 0.1}, "stop": {"stroke": 1.0}}
    scene["workpieces"]["sleeve"]["material"] = "other"
    return Scene.read({**scene, **changes})


def test_core_and_sleeve_balance_their_heat():
    """What is made, goes over, and is lost: each body has the rest. Air takes from the outer face of the sleeve only."""
    results = simulate(bimetal())
    last, heat = results.history.rows[-1], results.summary["ledger"]["heat"]["sums_mJ"]
    assert np.abs(results.history.column("heat_imbalance")).max() < 1e-8
    assert heat["through_core-sleeve"] > 0 and heat["by_friction.core-sleeve"] > 0 and heat["to_radiation"] > 0
    assert last["max_temperature_core_degC"] > 990 > 950 > last["min_temperature_core_degC"]
    assert last["min_temperature_sleeve_degC"] < 400 < last["max_temperature_sleeve_degC"]
    outer, boltzmann = 2 * np.pi * 10.4 * 11, 5.67e-11     # of both halves, mm²
    expected = 0.8 * boltzmann * outer * (673**4 - 293**4) * 0.05
    assert heat["to_radiation"] == pytest.approx(expected, rel=0.12), "the common surface does not radiate"
