"""A factorised system solved again with a few changed directions is the changed system."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

import fenics_forming as ff
from fenics_forming.physics.resolving import FewChanges, Unknowns


def vector(values) -> PETSc.Vec:
    return PETSc.Vec().createWithArray(np.array(values, float), comm=PETSc.COMM_SELF)


def test_few_changes_are_those_of_the_changed_matrix():
    """Woodbury's formula, to rounding: some unknowns in the vector, some behind it, a change that is not definite."""
    random = np.random.default_rng(3)
    root = random.standard_normal((9, 9))
    matrix, P, right = root @ root.T + np.eye(9), random.standard_normal((3, 9)), random.standard_normal(9)
    change = np.diag([50.0, -0.01, 3.0])
    split = lambda x: Unknowns(vector(x[:7]), np.array(x[7:]))  # noqa: E731
    whole = lambda u: np.concatenate([u.body.array, u.behind])  # noqa: E731
    few = FewChanges(lambda u: split(np.linalg.solve(matrix, whole(u))), [split(row) for row in P], change)
    expected = np.linalg.solve(matrix + P.T @ change @ P, right)
    np.testing.assert_allclose(whole(few.solve(split(right))), expected, rtol=1e-10)


def pressed(stroke: float, mode: str = "iterated", **keys) -> ff.Results:
    """A billet under a steel die, with Siebel's friction, whose limit knows no pressure."""
    return ff.simulate(ff.Scene.read({
        "geometry": "axisymmetric",
        "materials": {"metal": {"flow_stress": {"law": "swift", "K": 900.0, "prestrain": 0.01, "n": 0.2}},
                      "steel": {"young": 210e3, "poisson": 0.3}},
        "workpieces": {"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 10]}, "material": "metal",
                                  "symmetry": ["z"], "mesh_size": 1.2, **keys}},
        "tools": {"die": {"shape": {"kind": "rectangle", "from": [0, 10], "to": [40, 50]}, "material": "steel",
                          "mesh_size": {"contact": 1.2, "far": 8.0}, "held": {"z_high": ["r", "z"]},
                          "friction": {"law": "siebel", "factor": 0.6}, "drive": {"kind": "speed", "velocity": [0, -1]}}},
        "process": {"tool_deformation": mode}, "steps": {"stroke": 0.25}, "stop": {"stroke": stroke}}))


def test_a_billet_that_folds_onto_an_elastic_die_takes_two_iterations_a_solve():
    """4.3 a step of two solves in the second half (5.3 to 5.9 where each point that lands costs an iteration of its own).
    The die that deforms has its motions behind the unknowns."""
    assert pressed(5.0).history.column("newton_iterations")[10:].mean() < 4.5


def test_new_meshes_change_little_of_what_an_elastic_die_feels():
    """A new mesh every fourth step: force to 2 % of that on one mesh; deflection to 4 %, for the first step on a mesh knows
    of no force before it, and the die follows the one of half a step ago; volume to rounding."""
    one, new = pressed(4.0), pressed(4.0, remesh={"every": 4})
    assert new.summary["remeshings"] >= 3 and new.summary["deformation"]["die"]["factorisations"] == 1
    for name, slack in (("force_die_N", 0.02), ("deflection_die_mm", 0.04)):
        np.testing.assert_allclose(new.history.column(name), one.history.column(name), rtol=slack, atol=1e-6)
    assert abs(new.history.column("volume_error_billet")[-1]) < 1e-9
