"""Plane extrusion by one half through a square die (REFERENCES.md 4.2): limit load, and the process in its steady state."""

import numpy as np

import fenics_forming as ff
from fenics_forming import laws, meshing, solve_flow

from .measuring import Case, Trial
from .platens import LEVELS, held

EXACT, HALF = (2 + np.pi) / 4, 10.0       # p/2k, mm
TWO_K = 200 / np.sqrt(3)


def limit_load(size, growth=None):
    """Error of the ram pressure in one solve; container of half width 1."""
    outline = [(-1.5, 0), (0.5, 0), (0.5, 0.5), (0, 0.5), (0, 1), (-1.5, 1)]
    mesh = meshing.polygon(outline, size) if growth is None else \
        meshing.polygon(outline, 0.5, corners=[(0, 0.5)], corner_size=size, growth=growth)
    die = meshing.boundary_facets(mesh, lambda x: np.isclose(x[0], 0) & (x[1] > 0.5 - 1e-9))
    fixed = (held(mesh, 0, -1.5, 1, None) + held(mesh, 1, 1, None, 0) + held(mesh, 1, 0, None, 0)
             + [ff.FixedVelocity(die, 0, 0)])
    flow = solve_flow(mesh, kinematics="plane_strain", flow_stress=laws.Constant(value=100.0), fixed=fixed,
                      characteristic_rate=1.0)
    return flow.plastic_power / TWO_K / EXACT - 1, flow.workpiece.space.dofmap.index_map.size_global, 1


def process(step, zone=1.2, corner=0.4, scheme="implicit"):
    """Error of the mean pressure between 2 and 5 mm of travel; the mesh is renewed where it must be."""
    results = ff.simulate(ff.Scene.read({
        "geometry": "plane_strain", "materials": {"m": {"flow_stress": {"law": "constant", "value": 100}}},
        "workpieces": {"b": {"shape": {"kind": "polygon",
                                       "points": [[-18, 0], [4, 0], [4, 5], [0, 5], [0, HALF], [-18, HALF]]},
                             "symmetry": ["y"], "material": "m", "mesh_size": 2.5, "remesh": {"least_steps": 1},
                             "refine": [{"kind": "box", "from": [-7, 0], "to": [2, HALF], "size": zone},
                                        {"kind": "sphere", "centre": [0, 5], "radius": 1, "size": corner}]}},
        "tools": {"ram": {"shape": {"kind": "plane", "point": [-18, 0], "normal": [1, 0]},
                          "drive": {"kind": "speed", "velocity": [1, 0]}},
                  "die": {"shape": {"kind": "polyline", "side": "right",
                                    "points": [[-99, HALF], [0, HALF], [0, 5], [99, 99]]}}},
        "steps": {"stroke": step, "scheme": scheme}, "stop": {"stroke": 5.0},
        "output": {"fields_every": 0, "checkpoint_every": 0}}))
    steady = results.force("ram")[results.stroke("ram") >= 2.0].mean()
    return steady / (2 * HALF) / TWO_K / EXACT - 1, results.summary["dofs"], results.summary["steps"]


def trials():
    made = [Trial("limit load, fine at the corner", f"{size:g}", lambda s=size, g=growth: limit_load(s, g), size == 0.02)
            for size, growth in LEVELS]
    made += [Trial("limit load, one size", f"{size:g}", lambda s=size: limit_load(s)) for size in (0.2, 0.1, 0.05)]
    process_of = lambda name, step, *how: Trial(  # noqa: E731
        f"process, {name}", f"step {step:g} mm", lambda: process(step, *how), (step, *how) == (0.1, 1.2, 0.4),
        family="process")
    made += [process_of(f"{zone:g} mm", step, zone, corner) for zone, corner in ((1.8, 0.6), (1.2, 0.4))
             for step in (0.2, 0.1)]
    return made + [process_of("1.2 mm, explicit", step, 1.2, 0.4, "explicit") for step in (0.2, 0.1)]


CASE = Case("extrusion", "Plane extrusion, reduction 50 %, smooth container, square die", "the ram pressure", "unknowns",
            trials, "The pressure comes from above, of first order in the element size; the steps hardly change its mean.")
