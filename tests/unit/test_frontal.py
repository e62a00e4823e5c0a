"""The flow in the plane, solved by fronts: what MUMPS finds, and MUMPS where a matrix is not that of a flow."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

import fenics_forming as ff
from fenics_forming import laws, scene
from fenics_forming.physics.frontal.dissection import _leaves, _neighbours
from fenics_forming.physics.frontal.solver import FrontalSolver
from fenics_forming.physics.linear import DirectSolver
from fenics_forming.simulation.run import Simulation
from tests.unit.test_plane_matrix import CASES, block


def solved(case: str = "axisymmetric", mesh: float = 0.9):
    """A body between two iterations, the solver of its matrix and two vectors, the first of forces."""
    kind, law, more = CASES[case]
    described = block(kind, law, **more)
    top = described.workpieces["top"].model_copy(update={"mesh_size": mesh})
    body = Simulation(described.model_copy(update={"workpieces": {"top": top}})).body
    body.solve(0.0, body.new_history(), 0.1)
    system = body.solver.system
    system.assemble()
    b = body.solver.b.copy()
    b.array[:] = np.random.default_rng(5).standard_normal(b.array.size)
    b.array[body.workpiece.fixed_dofs] = 0.0
    return body.workpiece, system, b, b.duplicate()


def by_mumps(system, b) -> np.ndarray:
    solver, x = DirectSolver(system.matrix.petsc), b.duplicate()
    solver.factorise()
    solver.solve(b, x)
    return x.array


@pytest.mark.parametrize(("case", "mesh"), [("plane strain", 0.2), ("axisymmetric", 0.15), ("with inertia", 0.4),
                                            ("axisymmetric", 2.0)])
def test_fronts_find_what_mumps_finds(case, mesh):
    """Random forces and sources: velocities and pressures to 1e-8 of the greatest, the condition of the matrix (1e6) times
    rounding with some room. From hundreds of cells down to a single front."""
    body, system, b, x = solved(case, mesh)
    assert isinstance(system._solver, FrontalSolver) and system._solver.by_fronts
    system._solver.factorise()
    system._solver.solve(b, x)
    expected = by_mumps(system, b)
    pressures = np.setdiff1d(np.arange(len(expected)), body.velocity_dofs)
    for unknowns in (body.velocity_dofs.ravel(), pressures):
        np.testing.assert_allclose(x.array[unknowns], expected[unknowns], rtol=0,
                                   atol=1e-8 * np.abs(expected[unknowns]).max())


@pytest.mark.parametrize("count", [3, 9, 40, 2000])
def test_parts_of_a_mesh_share_straight_lines(count):
    """Triangles between random points: less than 0.85 of the shared sides of halves as their cells lie, whose common line
    turns from side to side. Every part has cells, also where there are few of them."""
    points = np.random.default_rng(2).random((count, 2)) * (3, 1)
    cells = Delaunay(points).simplices
    depth = max(0, int(np.ceil(np.log2(len(cells) / 8))))
    pairs = np.sort(cells[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    neighbours = _neighbours(np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1, 3))
    shared = []
    for known in (neighbours, np.full_like(neighbours, -1)):
        leaf = _leaves(points[cells], known, depth)
        assert set(leaf >> 1) == set(range(2**depth // 2)) or depth == 0
        shared.append(np.count_nonzero((leaf[neighbours] != leaf[:, None])[neighbours >= 0]))
    assert shared[0] <= shared[1] and (count < 2000 or shared[0] < 0.85 * shared[1])


def test_a_matrix_that_is_not_definite_gets_pivots():
    """One velocity that gives way the more it is pushed back: no factorisation of Cholesky, the answer of MUMPS."""
    body, system, b, x = solved()
    starts, columns, values = system.matrix.rows
    row = int(np.setdiff1d(body.velocity_dofs.ravel(), body.fixed_dofs)[3])
    values[starts[row] + np.flatnonzero(columns[starts[row]: starts[row + 1]] == row)] *= -1
    system.matrix.petsc.stateIncrease()
    system._solver.factorise()
    system._solver.solve(b, x)
    assert not system._solver.by_fronts
    np.testing.assert_allclose(x.array, by_mumps(system, b), rtol=0, atol=1e-12 * np.abs(x.array).max())
    system.assemble()
    system._solver.factorise()      # and by fronts again where they will do
    assert system._solver.by_fronts


@pytest.mark.parametrize("friction", [laws.Siebel(factor=1.0), laws.Sticking(), laws.Coulomb(coefficient=0.3)])
def test_no_solve_of_an_upsetting_needs_pivots(friction, monkeypatch):
    """A billet folded onto rough dies, by 50 %."""
    monkeypatch.setattr(FrontalSolver, "_factorise_with_pivots", lambda self: pytest.fail("not definite"))
    upset = block("axisymmetric", "perfect")
    plane = scene.Tool(shape=scene.Plane(point=(0, 2), normal=(0, -1)), friction=friction,
                    drive=laws.SpeedDrive(velocity=(0, -1)))
    ff.simulate(upset.model_copy(update={"tools": {"upper": plane}, "stop": scene.Stop(stroke=1.0)}))


def upset_between(dies: str, steps: int, **die) -> Simulation:
    """A flat billet on its mid-plane under one die that deforms, or two side by side."""
    steel = {"material": "steel", "mesh_size": {"contact": 1.5, "far": 8.0}, "held": {"z_high": ["r", "z"]},
             "friction": {"law": "siebel", "factor": 0.6}, "drive": {"kind": "speed", "velocity": [0, -1]}, **die}
    ends = {"one": [0, 40], "two": [0, 4, 40]}[dies]
    return Simulation(ff.Scene.read({
        "geometry": "axisymmetric",
        "materials": {"metal": {"flow_stress": {"law": "swift", "K": 900.0, "prestrain": 0.01, "n": 0.2}},
                      "steel": {"young": 210e3, "poisson": 0.3}},
        "workpieces": {"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 5]}, "material": "metal",
                                  "symmetry": ["z"], "mesh_size": 0.8}},
        "tools": {f"die{k}": {"shape": {"kind": "rectangle", "from": [first, 5], "to": [last, 45]}, **steel}
                  for k, (first, last) in enumerate(zip(ends, ends[1:], strict=False))},
        "process": {"tool_deformation": "iterated"}, "steps": {"stroke": 0.2}, "stop": {"stroke": 0.2 * steps}}))


@pytest.mark.parametrize("dies", ["one", "two"])
def test_fronts_find_the_motions_of_elastic_dies_that_mumps_finds(dies, monkeypatch):
    """Random forces on a billet and the dies' surfaces behind it, once the billet has begun to flow; no step needs pivots.
    Each kind of unknown to 1e-8 of the greatest, as above."""
    monkeypatch.setattr(FrontalSolver, "_factorise_with_pivots", lambda self: pytest.fail("not definite"))
    simulation = upset_between(dies, steps=3)
    simulation.run()
    body = simulation.body
    appended = body.solver.border._matrix
    assert isinstance(appended._solver, FrontalSolver) and appended._solver.by_fronts
    b, x = body.solver.b.copy(), body.solver.b.duplicate()
    random = np.random.default_rng(6)
    b.array[:], right = random.standard_normal(b.array.size), random.standard_normal(appended.count)
    motions = appended.solve(b, right, x)
    solver, whole, expected = DirectSolver(appended.petsc), *appended.petsc.createVecs()
    whole.array[:] = np.concatenate([b.array, right])
    solver.factorise()
    solver.solve(whole, expected)
    n = len(x.array)
    velocities = body.workpiece.velocity_dofs.ravel()
    for unknowns in (velocities, np.setdiff1d(np.arange(n), velocities), np.arange(n, n + len(motions))):
        np.testing.assert_allclose(np.concatenate([x.array, motions])[unknowns], expected.array[unknowns], rtol=0,
                                   atol=1e-8 * np.abs(expected.array[unknowns]).max())
