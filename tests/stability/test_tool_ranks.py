"""A deformable tool on two and three ranks against one: works, reactions, fields and compliance, to rounding."""

import os
import subprocess
import sys

import numpy as np
import pytest

pytestmark = pytest.mark.mpi

PROGRAM = """
import sys
import numpy as np
import fenics_forming as ff
from fenics_forming import FixedDisplacement, laws, meshing
from fenics_forming.physics.tool_body import global_dofs

law = laws.Elasticity(young=210e3, poisson=0.3, expansion=1e-5, hardening=[(0, 240), (1e-3, 280), (1, 500)])
for kind in sys.argv[1:]:
    mesh = meshing.box((0, 0, 0), (2, 1, 1), (4, 2, 2)) if kind == "3d" else meshing.rectangle((1, 0), (3, 1), (8, 4))
    dim = mesh.topology.dim
    low, high = (meshing.boundary_facets(mesh, lambda x: np.isclose(x[dim - 1], at)) for at in (0, 1))
    tool = ff.solve_tool(
        mesh, kinematics=kind, material=law, steps=3, temperature=40.0,
        held=[FixedDisplacement(low, i, 1e-4 * i) for i in range(dim)],
        springs=[ff.Springs(high, 1e3, 0), ff.Springs(high, 50.0), ff.PointSprings([(2,) + (1,) * (dim - 1)], 30.0, 1)],
        loads=[ff.Pressure(high, lambda x: 330 + 20 * x[:, 0]), ff.BodyForce((1.0,) + (0.0,) * (dim - 1)),
               ff.Centrifugal(1e-6, 300.0)])
    comm, own = mesh.comm, tool.body.dofs[:, 0] < tool.body.owned
    sums = [comm.allreduce(float((v[own] ** 2).sum())) for v in (tool.displacement, tool.stress, tool.plastic_strain)]
    answers = [tool.external_work, tool.elastic_energy, tool.spring_energy, tool.plastic_work, *tool.reaction(low), *sums]
    # the compliance of rows of nodes of the high face, whichever ranks have them
    chosen = own & np.isclose(tool.x[:, dim - 1], 1) & np.isclose(tool.x[:, [0]], [1, 2, 3]).any(axis=1)
    here = np.flatnonzero(chosen)
    dofs = np.concatenate(comm.allgather(global_dofs(tool.body, here).ravel()))
    answers.append((tool.solver.compliance(dofs) ** 2).sum())
    if comm.rank == 0:
        print(*answers, sep="\\n")
"""


def answers(ranks: int, *kinds: str) -> np.ndarray:
    launcher = [] if ranks == 1 else ["mpirun", "-n", str(ranks)]
    done = subprocess.run([*launcher, sys.executable, "-c", PROGRAM, *kinds], capture_output=True, text=True, timeout=120,
                          env=os.environ)
    assert done.returncode == 0, done.stderr[-2000:]
    found = np.array(done.stdout.split(), float)
    assert len(found) > 9 * len(kinds) and (np.abs(found) > 0).all()
    return found


@pytest.mark.parametrize("ranks, kinds", [(2, ["plane_strain", "plane_stress", "axisymmetric", "3d"]),
                                          (3, ["plane_strain"])])
def test_number_of_ranks_changes_nothing(ranks, kinds):
    """In the plane one of three ranks has no facet of the loaded face."""
    # forces balance to 1e-9 of the largest at the tolerance, far better after the last, quadratic iteration
    assert answers(ranks, *kinds) == pytest.approx(answers(1, *kinds), rel=1e-10)
