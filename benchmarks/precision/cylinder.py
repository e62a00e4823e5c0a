"""A thick cylinder that yields from its bore outwards (REFERENCES.md 6.6): elements and load steps of an elastic-plastic
tool."""

import fenics_forming as ff

from .measuring import Case, Trial

EXACT = {120: (0.111108, 0.070420), 140: (0.139815, 0.087288), 160: (0.183435, 0.111645), 190: (0.362383, 0.205405)}
LOADS = {4: (120, 140, 160, 190), 6: (100, 120, 140, 160, 180, 190), 12: (*range(100, 175, 10), 175, 180, 185, 190)}


def widened(size, number):
    """Error of the displacements of bore and outside, in so many load steps."""
    results = ff.simulate(ff.Scene.read({
        "geometry": "axisymmetric", "materials": {"steel": {"young": 210e3, "poisson": 0.3, "yield_stress": 240}},
        "tools": {"cylinder": {"shape": {"kind": "rectangle", "from": [100, 0], "to": [200, 20]}, "material": "steel",
                               "mesh_size": size, "held": {"z_low": "z", "z_high": "z"},
                               "loads": {"r_low": {"pressure": 190}}}},
        "points": {"bore": {"body": "cylinder", "at": [100, 0]}, "outside": {"body": "cylinder", "at": [200, 0]}},
        "steps": {"loads": [load / 190 for load in LOADS[number]]}}))
    rows = {round(190 * row["load_factor"]): row for row in results.history.rows}
    errors = [rows[load][f"{place}_displacement_r_mm"] / exact - 1 for load, both in EXACT.items()
              for place, exact in zip(("bore", "outside"), both, strict=True)]
    return max(map(abs, errors)), results.summary["dofs"], number


def trials():
    return [Trial(f"{number} load steps", f"{size:g} mm", lambda s=size, n=number: widened(s, n), (size, number) == (10, 6))
            for number in LOADS for size in (50, 20, 10, 5, 2.5)]


CASE = Case("cylinder", "Thick cylinder, elastic-plastic up to 99 % of its collapse", "the displacements", "unknowns",
            trials, "Load steps count more than elements: a tenth of the wall is enough for an element.")
