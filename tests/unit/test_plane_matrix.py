"""The compiled tangent of a flow in the plane is that of the forms, whatever terms a body has."""

from __future__ import annotations

import basix
import numpy as np
import pytest
import ufl
from dolfinx import fem

from fenics_forming import laws, scene
from fenics_forming.physics.nodes import QUADRATURE_DEGREE
from fenics_forming.physics.plane_matrix import PlaneMatrix
from fenics_forming.physics.system import SystemMatrix
from fenics_forming.simulation.run import Simulation

LAWS = {"perfect": laws.Linear(initial=100, hardening=50), "rate": laws.NortonHoff(K=100, m=0.3)}


def block(kind, law, pair=False, **process):
    """A block, or one on another, beside its axis or mirror plane, under a roll with friction."""
    low = {"low": scene.Workpiece(shape=scene.Rectangle(from_=(0, -1), to=(3, 0)), material="m", mesh_size=0.9,
                                  symmetry=["y" if kind == "plane_strain" else "z"])}
    top = {"top": scene.Workpiece(shape=scene.Rectangle(from_=(0, 0), to=(2, 2)), material="m", mesh_size=0.9,
                                  symmetry=[] if pair else ["y" if kind == "plane_strain" else "z"])}
    return scene.Scene(
        geometry=kind, materials={"m": scene.Material(flow_stress=LAWS[law], density="7800 kg/m^3")},
        workpieces=low | top if pair else top,
        tools={"roll": scene.Tool(shape=scene.CircleTool(centre=(1, 6), radius=4), friction=laws.Siebel(factor=0.5),
                                  drive=laws.SpeedDrive(velocity=(0, -1)))},
        contacts=[scene.Contact(between=("low", "top"))] if pair else [], process=scene.Process(**process),
        steps=scene.Steps(stroke=0.1), stop=scene.Stop(stroke=0.2))


CASES = {"plane strain": ("plane_strain", "perfect", {}), "axisymmetric": ("axisymmetric", "rate", {}),
         "with inertia": ("axisymmetric", "perfect", {"inertia": True}),
         "two bodies": ("plane_strain", "rate", {"pair": True})}


@pytest.mark.parametrize("case", CASES)
def test_compiled_tangent_is_that_of_the_forms(case):
    """In the middle of a solve, on curved cells; also what velocities that are given but not met yet add."""
    kind, law, more = CASES[case]
    body = Simulation(block(kind, law, **more)).body
    x = body.x
    x[:] += 0.03 * np.sin(2 * x[:, ::-1] + 1) * (x != 0)
    body.solve(0.0, body.new_history(), 0.1)
    work = body.workpiece
    work.tau += 20 * np.random.default_rng(8).standard_normal(work.tau.shape)     # not that of the velocities
    work.cut_stress(work.point_rate())
    forms, kernels = SystemMatrix(work.tangent_form), PlaneMatrix(work)
    loads = []
    work.solution.x.array[work.fixed_dofs] += 0.1
    for matrix in (forms, kernels):
        matrix.assemble(work.conditions)
        loads.append(body.solver.b.duplicate())
        matrix.lift(loads[-1], work)
    free = np.setdiff1d(np.arange(work.owned), work.fixed_dofs)
    scale = np.abs(loads[0].array[free]).max()
    np.testing.assert_allclose(loads[1].array[free], loads[0].array[free], rtol=0, atol=1e-10 * scale)
    difference = forms.petsc.copy()
    difference.axpy(-1.0, kernels.petsc)
    assert difference.norm() < 1e-11 * forms.petsc.norm()      # the forms round their tables


@pytest.mark.parametrize("kind", ["plane_strain", "axisymmetric"])
def test_compiled_strain_rates_are_those_of_the_kinematics(kind):
    """Of any velocities, on curved cells."""
    work = Simulation(block(kind, "perfect")).body.workpiece
    x = work.nodes.x
    x[:] += 0.03 * np.sin(2 * x[:, ::-1] + 1) * (x != 0)
    work.increment.x.array[:] = np.random.default_rng(3).standard_normal(len(work.increment.x.array))
    points, _ = basix.make_quadrature(basix.CellType.triangle, QUADRATURE_DEGREE[2])
    rates = fem.Expression(work.kinematics.strain_rate(ufl.split(work.increment)[0]), points)
    expected = rates.eval(work.nodes.mesh, np.arange(len(work.nodes.cells), dtype=np.int32))
    np.testing.assert_allclose(work.rate_of_increment().ravel(), expected.ravel(), rtol=0,
                               atol=1e-11 * np.abs(expected).max())      # the forms round their tables
