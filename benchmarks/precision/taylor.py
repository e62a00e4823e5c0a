"""Taylor's copper rod (REFERENCES.md 8.4): meshes, steps and schemes of a body with inertia."""

from functools import cache

import numpy as np

import fenics_forming as ff
from demos.taylor_impact import SCENE

from .measuring import Case, Trial

FINEST = (0.6, 160)         # mm, steps: the reference
TIME = 80e-6


def rod(mesh, steps, scheme="implicit", remesh=True):
    """Length and radius of the foot at the end, mm, and the run."""
    scene = ff.read_scene(SCENE, set=[f"workpieces.rod.mesh_size={mesh}", f"steps.time={TIME / steps}",
                                      "output.fields_every=0", f"steps.scheme={scheme}",
                                      f"workpieces.rod.remesh={str(remesh).lower()}"])
    results = ff.simulate(scene)
    extents = results.summary["extents_mm"]["rod"]
    return np.array([np.ptp(extents["z"]), extents["r"][1]]), results


@cache
def best():
    return rod(*FINEST)[0]


def off(mesh, steps, scheme="implicit", remesh=True):
    """Larger of the errors of length and foot, against the finest run."""
    found, results = rod(mesh, steps, scheme, remesh)
    return np.abs(found / best() - 1).max(), results.summary["dofs"], results.summary["steps"]


def trials():
    best()
    made = [Trial(f"implicit, {mesh:g} mm", f"{n} steps", lambda m=mesh, n=n: off(m, n), (mesh, n) == (0.8, 120))
            for mesh in (1.2, 0.8) for n in (30, 60, 120)]
    made += [Trial(f"{scheme}, 0.8 mm", f"{n} steps", lambda s=scheme, n=n: off(0.8, n, s))
             for scheme in ("explicit", "etd2") for n in (30, 60, 120)]
    return made + [Trial("implicit, 0.8 mm, one mesh", f"{n} steps", lambda n=n: off(0.8, n, remesh=False))
                   for n in (60,)]


CASE = Case("taylor", "Copper rod against a wall at 227 m/s", "length and foot", "steps", trials,
            "The volume is given back at every step, so the explicit scheme is as exact here as the implicit one and a "
            "quarter cheaper; etd2 is not.")
