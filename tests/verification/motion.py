"""Bodies with inertia that the tests share: a falling block, fast upsetting, Taylor's rods."""

from __future__ import annotations

import numpy as np

from fenics_forming import Scene

STEEL = {"flow_stress": {"law": "constant", "value": 100}, "density": "7850 kg/m^3"}
COPPER = {"length": 32.4, "radius": 3.2, "speed": 227e3, "time": 80e-6,
          "material": {"flow_stress": {"law": "linear", "initial": 400, "hardening": 100}, "density": "8930 kg/m^3"}}
ALUMINIUM = {"length": 23.47, "radius": 3.81, "speed": 373e3, "time": 35e-6,
             "material": {"flow_stress": {"law": "constant", "value": 420}, "density": "2700 kg/m^3"}}


def falling(scheme: str, steps: int, geometry: str = "axisymmetric", **more) -> Scene:
    """A steel block that falls for 0.1 s, touched by nothing, with a point in it."""
    shape = {"axisymmetric": {"kind": "rectangle", "from": [0, 0], "to": [10, 20]},
             "plane_strain": {"kind": "rectangle", "from": [0, 0], "to": [10, 20]},
             "3d": {"kind": "box", "from": [0, 0, 0], "to": [10, 10, 20]}}[geometry]
    at = [0, 10] if geometry != "3d" else [5, 5, 10]
    return Scene(geometry=geometry, materials={"steel": STEEL}, tools={}, process={"inertia": True, "weight": True},
                 workpieces={"block": {"shape": shape, "material": "steel", "mesh_size": 10}},
                 points={"middle": {"body": "block", "at": at}},
                 steps={"time": 0.1 / steps, "scheme": scheme} | more, stop={"time": 0.1})


def fast_upsetting(speed: float, steps: int, geometry: str = "axisymmetric", scheme: str = "implicit", **more) -> Scene:
    """20 mm of steel halved by a smooth die at constant speed, mm/s, from the homogeneous flow on (REFERENCES 8.1)."""
    lateral = {"axisymmetric": ["z"], "plane_strain": ["x", "y"]}[geometry]
    return Scene(geometry=geometry, materials={"steel": STEEL}, process={"inertia": True},
                 workpieces={"block": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 20]}, "material": "steel",
                                       "mesh_size": 5, "symmetry": lateral,
                                       "initial_velocity": {"kind": "homogeneous", "rate": -speed / 20,
                                                            "axis": lateral[-1]}}},
                 tools={"die": {"shape": {"kind": "plane", "point": [0, 20], "normal": [0, -1]},
                                "drive": {"kind": "speed", "velocity": [0, -speed]}}},
                 steps={"stroke": 10 / steps, "scheme": scheme} | more, stop={"stroke": 10})


def rod(case: dict, steps: int, mesh_size: float, *, remesh=None, **more) -> Scene:
    """A rod that flies against a smooth rigid wall (REFERENCES 8.4 and 8.5)."""
    body = {"shape": {"kind": "rectangle", "from": [0, 0], "to": [case["radius"], case["length"]]}, "material": "metal",
            "mesh_size": mesh_size, "initial_velocity": [0, -case["speed"]]}
    return Scene(geometry="axisymmetric", materials={"metal": case["material"]}, process={"inertia": True},
                 workpieces={"rod": body | ({} if remesh is None else {"remesh": remesh})},
                 tools={"wall": {"shape": {"kind": "plane", "point": [0, 0], "normal": [0, 1]}}},
                 points={"tail": {"body": "rod", "at": [0, case["length"]]}},
                 steps={"time": case["time"] / steps}, stop={"time": case["time"]}, **more)


def length_and_foot(results) -> tuple[float, float]:
    """Final length and greatest radius of a rod, mm."""
    extents = results.summary["extents_mm"]["rod"]
    return float(np.ptp(extents["z"])), extents["r"][1]
