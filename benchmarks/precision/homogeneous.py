"""Smooth compression of a rate-dependent cylinder (REFERENCES.md 1.1): what the schemes make of exact flow."""

import fenics_forming as ff

from .measuring import Case, Trial

STROKES, EXACT = (5.0, 10.0, 14.0), (49807.19, 92763.04, 181704.98)     # mm, N
SCHEMES = ("explicit", "implicit", "trapezoid", "etd2", "substeps")


def compressed(steps, mesh=5.0, **stepping):
    """Error of the force where 20 mm have become 15, 10 and 6 mm, at 1 mm/s."""
    results = ff.simulate(ff.Scene.read({
        "geometry": "axisymmetric",
        "materials": {"m": {"flow_stress": {"law": "power", "K": 200.0, "n": 0.2, "m": 0.1}}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 20]}, "material": "m",
                             "mesh_size": mesh, "symmetry": ["z"]}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 20], "normal": [0, -1]},
                            "drive": {"kind": "speed", "velocity": [0, -1]}}},
        "steps": {"stroke": 14.0 / steps, **stepping}, "stop": {"stroke": 14.0},
        "output": {"strokes": list(STROKES), "fields_every": 0, "checkpoint_every": 0}}))
    # the upper half of 40 mm at 1 mm/s is strained as fast as 20 mm
    errors = [results.at(stroke=s)["force_upper_N"] / exact - 1 for s, exact in zip(STROKES, EXACT, strict=True)]
    return max(map(abs, errors)), results.summary["dofs"], results.summary["steps"]


def trials():
    made = [Trial(scheme, f"{n} steps", lambda n=n, scheme=scheme: compressed(n, scheme=scheme),
                  (scheme, n) == ("implicit", 28))
            for scheme in SCHEMES for n in (14, 28, 56, 112)]
    made += [Trial("implicit, adaptive", "0.001", lambda: compressed(14, adaptive=True), True)]
    return made + [Trial("implicit, 28 steps, meshes", f"{mesh:g} mm", lambda mesh=mesh: compressed(28, mesh=mesh))
                   for mesh in (10.0, 2.5)]


CASE = Case("homogeneous", "Smooth compression of a viscoplastic cylinder by 70 %", "the force", "steps", trials,
            "The flow is linear, so the mesh changes the time alone. Order one for the explicit scheme and its sub-steps, "
            "two for the others.")
