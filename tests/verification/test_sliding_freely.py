"""A block between smooth, parallel platens is free to slide along them: it stays where it is and spreads to both sides."""

from __future__ import annotations

from math import log

import pytest

import fenics_forming as ff

BOX = {"plane_strain": {"kind": "rectangle", "from": [-10, 0], "to": [10, 8]},
       "3d": {"kind": "box", "from": [-10, -6, 0], "to": [10, 6, 8]}}


@pytest.mark.parametrize("kind", BOX)
def test_block_between_smooth_platens_stays_in_the_middle(kind):
    """By 30 %. Nothing but a drag of a millionth of the power holds it (without: -28 to +14 mm, by chance). Force of the
    homogeneous flow to 0.1 %, the share of its steps in the spread."""
    up = {"plane_strain": [0, 1], "3d": [0, 0, 1]}[kind]
    results = ff.simulate(ff.Scene.read({
        "geometry": kind, "materials": {"m": {"flow_stress": {"law": "linear", "initial": 300, "hardening": 100}}},
        "workpieces": {"b": {"shape": BOX[kind], "material": "m", "mesh_size": 4}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [8 * c for c in up], "normal": [-c for c in up]},
                            "drive": {"kind": "speed", "velocity": [-2 * c for c in up]}},
                  "lower": {"shape": {"kind": "plane", "point": [0] * len(up), "normal": up}}},
        "steps": {"stroke": 0.4}, "stop": {"stroke": 2.4}}))
    strain, width = -log(0.7), 20.0
    factor = 2 / 3**0.5 if kind == "plane_strain" else 1.0
    force = factor * (300 + 100 * factor * strain) * (width if kind == "plane_strain" else width * 12) / 0.7
    assert results.force("upper")[-1] == pytest.approx(force, rel=1e-3)
    extents = results.summary["extents_mm"]["b"]
    for axis in ("x", "y")[: len(up) - 1]:
        assert sum(extents[axis]) == pytest.approx(0.0, abs=1e-3), axis
