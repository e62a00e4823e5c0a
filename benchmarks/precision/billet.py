"""The billet between rough dies to 60 % (REFERENCES.md 3.3): schemes, meshes and steps where sides fold onto the dies.

When a side lands is chance on any one mesh, so every point of the diagram is the mean of three meshes that differ by 4 %.
"""

import numpy as np

import fenics_forming as ff
from demos.billet_upsetting import HEIGHT, SCENE

from .measuring import Case, Trial

CONVERGED = {0.1: 261.7, 0.2: 307.4, 0.3: 366.1, 0.4: 449.6, 0.5: 585.0, 0.6: 864.0}      # kN, in mesh and step


ALIKE = (0.96, 1.0, 1.04)


def upset(mesh, *how, **stepping):
    """Mean of the errors on three meshes of nearly the same size, and the cost of the middle one."""
    found = [one(part * mesh, *how, **stepping) for part in ALIKE]
    return np.mean([error for error, *_ in found]), *found[1][1:]


def one(mesh, step, scheme="implicit", **stepping):
    """Largest error of the force at 10, 20 … 60 %."""
    strokes = [q * HEIGHT for q in CONVERGED]
    more = [f"steps.{key}={str(value).lower()}" for key, value in stepping.items()]
    results = ff.simulate(ff.read_scene(SCENE, set=[
        f"workpieces.billet.mesh_size={mesh}", f"steps.stroke={step}", f"steps.scheme={scheme}", *more,
        f"output.strokes={strokes}", "output.fields_every=0", "output.checkpoint_every=0"]))
    errors = [results.at(stroke=s)["force_upper_N"] / kN / 1e3 - 1
              for s, kN in zip(strokes, CONVERGED.values(), strict=True)]
    return max(map(abs, errors)), results.summary["dofs"], results.summary["steps"]


def trials():
    made = [Trial(f"implicit, {mesh:g} mm", f"step {step:g} mm", lambda m=mesh, s=step: upset(m, s),
                  (mesh, step) == (1, 0.25), len(ALIKE))
            for mesh in (2.5, 1.5, 1.0, 0.7) for step in (0.9, 0.45, 0.25)]
    made += [Trial(f"{scheme}, 1 mm", f"step {step:g} mm", lambda k=scheme, s=step: upset(1.0, s, k), runs=len(ALIKE))
             for scheme in ("explicit", "substeps", "trapezoid", "etd2") for step in (0.9, 0.45, 0.25)]
    return made + [Trial("implicit, 1 mm, adaptive", "0.001", lambda: upset(1.0, 0.9, adaptive=True), True, len(ALIKE))]


CASE = Case("billet", "Billet between rough dies, 60 %: sides fold onto the dies", "the force", "steps", trials,
            "Means of three meshes that differ by 4 %. From 24 steps on the mesh is what is left. The trapezoid takes four "
            "times as long, and etd2 and sub-steps need short steps where sides land.")
