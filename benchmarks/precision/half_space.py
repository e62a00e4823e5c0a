"""Hot steel on a cold die (REFERENCES.md 9.1): two half spaces after 0.1 s, by columns and by temperature fields."""

import numpy as np

import fenics_forming as ff

from .measuring import Case, Trial

TIME, STEEL, DIE = 0.1, 990.866, 413.447        # s, surfaces in degC; they were 1200 and 200
LENGTH = 12 * np.sqrt(8 * TIME)


def metal(conductivity, capacity, density):
    return {"conductivity": f"{conductivity} W/m/K", "specific_heat": f"{capacity} J/kg/K", "density": f"{density} kg/m^3"}


def touched(kind, size, steps):
    """Error of the temperature of the steel's face, of what it could cool by."""
    high = 3 * size
    exchange = {"kind": kind, "temperature": 200, "coefficient": "10000 W/m^2/K"}
    tool = {"shape": {"kind": "rectangle", "from": [-LENGTH, 0], "to": [0, high]}, "material": "die",
            "heat_exchange": exchange}
    if kind == "coupled":
        tool["mesh_size"] = {"contact": size, "far": 12 * size}
    else:
        tool["shape"] = {"kind": "plane", "point": [0, 0], "normal": [1, 0]}
    results = ff.simulate(ff.Scene.read({
        "geometry": "plane_strain", "materials": {"steel": metal(25, 650, 7500), "die": metal(30, 500, 7800)},
        "workpieces": {"bar": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [LENGTH, high]}, "material": "steel",
                               "temperature": 1200, "mesh_size": 12 * size,
                               "refine": [{"kind": "box", "from": [0, 0], "to": [size, high], "size": size}]}},
        "tools": {"die": tool}, "points": {"face": {"body": "bar", "at": [0, high / 2]}},
        "process": {"flow": False}, "steps": {"time": TIME / steps}, "stop": {"time": TIME},
        "output": {"fields_every": 0, "checkpoint_every": 0}}))
    face = results.history.column("face_temperature_degC")[-1]
    return (face - STEEL) / 1000, results.summary["dofs"], results.summary["steps"]


def trials():
    made = []
    for kind, word in (("coupled", "field in the die"), ("column", "columns in the die")):
        made += [Trial(f"{word}, {size:g} mm", f"{n} steps", lambda k=kind, s=size, n=n: touched(k, s, n),
                       (kind, size, n) == ("column", 0.1, 40)) for size in (0.4, 0.1) for n in (10, 20, 40, 80)]
    return made + [Trial("die at constant temperature, 0.1 mm", "40 steps", lambda: touched("constant", 0.1, 40))]


CASE = Case("half_space", "Hot steel on a cold die for 0.1 s", "the surface temperature, of 1000 K,", "steps", trials,
            "Columns in the die are as exact as a field in it and cost less; a die of constant temperature is 4 % off.")
