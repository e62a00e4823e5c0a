"""Heat and flow together: adiabatic heating, softening, and the friction heat of a tool that slides."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_forming import simulate
from fenics_forming.scene import Scene

SWIFT = {"law": "swift", "K": 100.0 * 5**0.3, "prestrain": 0.2, "n": 0.3}
# sigma = 600 (1 - 1e-3 (T - 20)), as Johnson and Cook's law with m = 1
SOFTENING = {"law": "johnson_cook", "A": 600, "B": 0, "n": 1, "m": 1, "reference_temperature": 20,
             "melting_temperature": 1020}
WARMING = {"constant": ({"law": "constant", "value": 100}, 17.27589), "swift": (SWIFT, 22.99198),
           "softening": (SOFTENING, 98.46404)}


def upset(law, *, steps=40, tool=None, process=None):
    """A smooth cylinder from 20 to 10 mm, insulated."""
    return simulate(Scene.read({
        "geometry": "axisymmetric",
        "materials": {"m": {"flow_stress": law, "density": "7850 kg/m^3", "specific_heat": "460 J/kg/K",
                            "conductivity": "40 W/m/K", "plastic_heat_fraction": 0.9}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 10]}, "material": "m",
                             "mesh_size": 5.0, "symmetry": ["z"], "temperature": 20}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 10], "normal": [0, -1]},
                            "drive": {"kind": "speed", "velocity": [0, -1]}, **(tool or {})}},
        "process": process or {}, "steps": {"stroke": 5.0 / steps}, "stop": {"stroke": 5.0}}))


@pytest.mark.parametrize("law", WARMING)
def test_plastic_work_heats_an_insulated_cylinder(law, verified):
    """REFERENCES.md 9.2, within 0.5 %; uniform to rounding, and with softening the force falls with it."""
    given, warming = WARMING[law]
    results = upset(given)
    last = results.history.rows[-1]
    verified("9.2", f"warming, {law}", (last["max_temperature_degC"] - 20, last["min_temperature_degC"] - 20),
             (warming, warming), within=5e-3, unit="K", at=("hottest place", "coldest place"))
    assert np.abs(results.history.column("heat_imbalance")).max() < 1e-8
    if law == "softening":
        verified("9.2", "force of the softened cylinder", last["force_upper_N"], 339871.05, within=5e-3, unit="N")


@pytest.mark.parametrize(("scheme", "steps"), [("midpoint", 5), ("trapezoid", 5), ("etd2", 10)])
def test_temperature_acts_within_the_step(scheme, steps):
    """Of second order: 1 % with steps of 20 K (etd2, which extrapolates: 10 K), each of which softens the metal by 3 %."""
    results = upset(SOFTENING, steps=steps, process={"shifting": scheme})
    assert results.history.rows[-1]["max_temperature_degC"] - 20 == pytest.approx(98.46404, rel=1e-2)


def test_heat_that_is_made_is_the_share_of_the_work_that_is_done():
    """0.9 of the plastic work, and the friction work whole where the tool insulates: against the power of the tool."""
    results = upset(WARMING["constant"][0], tool={"friction": {"law": "siebel", "factor": 0.5}}, steps=20)
    history, heat = results.history, results.summary["ledger"]["heat"]["sums_mJ"]
    stroke, force = history.column("stroke_upper_mm"), history.column("force_upper_N")
    work = np.trapezoid(force, stroke) * 2     # of both dies: half of the body is modelled, the heat is that of all of it
    assert heat["by_plastic"] / 0.9 + heat["by_friction.upper"] == pytest.approx(work, rel=1e-2)
    assert heat["by_friction.upper"] > 0.02 * work
