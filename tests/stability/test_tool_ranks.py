"""A deformable tool on two and three ranks against one: works, reactions, fields and compliance, to rounding."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fenics_forming.results import Results

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


STACKED = """
import sys
import numpy as np
from mpi4py import MPI
from fenics_forming import FixedDisplacement, Pressure, laws, meshing
from fenics_forming.physics.gather import gather_cells, gather_nodal
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.parallel import total
from fenics_forming.physics.tool_body import AssembledSolver, PartContact, ToolBody, fields

parts = [Nodes(meshing.rectangle((0, 0), (10, 10), (4, 4))), Nodes(meshing.rectangle((2, 10.01), (8, 16), (5, 4)))]
x, cells = [gather_nodal(n, n.x) for n in parts], [gather_cells(n) for n in parts]
if MPI.COMM_WORLD.rank == 0:
    mesh = meshing.from_arrays(np.concatenate(x), np.concatenate([cells[0], cells[1] + len(x[0])]))
else:
    mesh = meshing.from_arrays(np.empty((0, 2)), np.empty((0, 6), np.int64))
low, below, above, high = (meshing.boundary_facets(mesh, lambda x, at=at: np.isclose(x[1], at))
                           for at in (0, 10, 10.01, 16))
law = laws.Elasticity(young=210e3, poisson=0.3, yield_stress=240, hardening=5e3)
held = [FixedDisplacement(low, i) for i in (0, 1)] + [FixedDisplacement(high, 0, 0.02), FixedDisplacement(high, 1, -0.05)]
body = ToolBody(Nodes(mesh), kinematics="plane_strain", material=law, held=held)
solver = AssembledSolver(body, [PartContact(above, below, friction=eval(sys.argv[1]))])
solver.solve(steps=3)
tool, contact = fields(solver), solver.contacts[0]
pressure, weights = contact.state.pressure, contact.weights
pressed = total(mesh.comm, np.array([pressure @ weights, pressure**2 @ weights]))
answers = [tool.external_work, tool.elastic_energy, tool.plastic_work, tool.reaction(low)[1], *pressed,
           total(mesh.comm, float(solver.plastic.effective @ body.volumes))]
if contact.has_friction:
    answers += [tool.reaction(low)[0], solver.friction_work]
if mesh.comm.rank == 0:
    print(*answers, sep="\\n")
"""


def answers(ranks: int, program: str, *words: str) -> np.ndarray:
    launcher = [] if ranks == 1 else ["mpirun", "-n", str(ranks)]
    done = subprocess.run([*launcher, sys.executable, "-c", program, *words], capture_output=True, text=True, timeout=900,
                          env=os.environ)
    assert done.returncode == 0, done.stderr[-2000:]
    found = np.array(done.stdout.split(), float)
    assert len(found) >= 7 and (np.abs(found) > 0).all()
    return found


@pytest.mark.parametrize("ranks, kinds", [(2, ["plane_strain", "plane_stress", "axisymmetric", "3d"]),
                                          (3, ["plane_strain"])])
def test_number_of_ranks_changes_nothing(ranks, kinds):
    """In the plane one of three ranks has no facet of the loaded face."""
    # forces balance to 1e-9 of the largest at the tolerance, far better after the last, quadratic iteration
    assert answers(ranks, PROGRAM, *kinds) == pytest.approx(answers(1, PROGRAM, *kinds), rel=1e-10)


@pytest.mark.parametrize("friction, allowed", [("laws.NoFriction()", 1e-9), ("laws.Coulomb(coefficient=0.2)", 1e-8)])
def test_parts_that_press_on_one_another_on_two_ranks(friction, allowed):
    """A smaller block comes down and aside through a gap on a larger one, its corners yield; meshes that do not match.
    Friction is a twentieth of the largest force, to 1e-9 of which forces balance."""
    assert answers(2, STACKED, friction) == pytest.approx(answers(1, STACKED, friction), rel=allowed)


def on_ranks(count: int, *words: str) -> None:
    """``forming`` with these words on ``count`` ranks."""
    done = subprocess.run(["mpirun", "-n", str(count), sys.executable, "-m", "fenics_forming", *words], capture_output=True,
                          text=True, timeout=900, env=os.environ)
    assert done.returncode == 0, done.stderr[-2000:]


def test_stresses_of_an_assembled_tool_after_forming_on_two_ranks(tmp_path):
    """The forming run, its contact forces and the shrink-fitted die behind them, all on two ranks against one."""
    scene = str(Path(__file__).parents[2] / "demos" / "scenes" / "assembled_die.toml")
    coarse = [f"--set={change}" for change in (
        "workpieces.billet.mesh_size=4", "steps.stroke=0.2", "stop.stroke=0.2", "materials.insert_steel.yield_stress=450")]
    for ranks in (1, 2):
        folder = str(tmp_path / str(ranks))
        on_ranks(ranks, "run", scene, "--out", folder, "--quiet", *coarse)
        on_ranks(ranks, "stresses", folder, "die", "--quiet")
    one, two = (Results.read(tmp_path / ranks / "die").history for ranks in ("1", "2"))
    assert one.columns == two.columns and one.rows[-1]["max_effective_strain_die"] > 0
    for name in set(one.columns) - {"wall_s"}:
        assert two.column(name) == pytest.approx(one.column(name), rel=1e-7, abs=1e-7 * np.abs(one.column(name)).max())
