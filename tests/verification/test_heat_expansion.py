"""A die that is warmed by the workpiece expands towards it."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_forming import simulate
from fenics_forming.scene import Scene

EXPANSION, POISSON, CAPACITY, RADIUS = 1.2e-5, 0.3, 7800e-12 * 500e6, 10.0


def pressed(expansion):
    """A short stroke of a hot billet under a die as wide as it is, held all around: heat and strains go along z only."""
    return simulate(Scene.read({
        "geometry": "axisymmetric",
        "materials": {"steel": {"flow_stress": {"law": "constant", "value": 20}, "density": "7500 kg/m^3",
                                "conductivity": "28 W/m/K", "specific_heat": "650 J/kg/K"},
                      "die": {"density": "7800 kg/m^3", "conductivity": "30 W/m/K", "specific_heat": "500 J/kg/K",
                              "young": "210 GPa", "poisson": POISSON, "expansion": expansion}},
        "workpieces": {"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [RADIUS, 10]}, "symmetry": ["z"],
                                  "material": "steel", "temperature": 1150, "mesh_size": 2.5}},
        "tools": {"upper": {"shape": {"kind": "rectangle", "from": [0, 10], "to": [RADIUS, 30]}, "material": "die",
                            "mesh_size": {"contact": 0.5, "far": 4}, "held": {"z_high": "z", "r_high": "r"},
                            "drive": {"kind": "speed", "velocity": [0, -0.1]},
                            "heat_exchange": {"kind": "coupled", "temperature": 250, "coefficient": 10}}},
        "steps": {"stroke": 0.00125}, "stop": {"stroke": 0.05}}))


def test_a_die_expands_by_the_heat_that_it_has_taken_up():
    """Held sideways, a layer of the temperature rise θ(z) becomes thicker by (1 + ν) / (1 - ν) α ∫ θ dz, and ∫ θ dz is the
    heat over the surface and the heat capacity. The workpiece follows in the step after: 1.2 % with 40 steps of √t."""
    warm, stiff = pressed(EXPANSION), pressed(0.0)
    heat = warm.history.rows[-1]["heat_to_upper_J"] * 1000 / 2         # of the upper half
    expected = (1 + POISSON) / (1 - POISSON) * EXPANSION * heat / (np.pi * RADIUS**2 * CAPACITY)
    heights = [run.summary["extents_mm"]["billet"]["z"][1] for run in (stiff, warm)]
    assert heights[0] - heights[1] == pytest.approx(expected, rel=0.03)
    assert warm.summary["tools"]["upper"]["upper"]["largest_von_mises_MPa"] > 5 * \
        stiff.summary["tools"]["upper"]["upper"]["largest_von_mises_MPa"], "expansion that is held back"
