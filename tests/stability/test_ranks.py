"""The number of ranks changes nothing: histories on two and three ranks against one, to rounding."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from fenics_forming.results import Results

from .scenes import BILLET, BLOCK, COARSE_BILLET, COARSE_RING, CUBE, EXTRUSION, PUNCHES, RING, run, scene_file, swept

pytestmark = pytest.mark.mpi
ROUNDING = 1e-8     # relative to the largest value of a column; sums of another order, of 200 dofs and 10 steps


def on_ranks(count: int, text: str, folder, *changes: str, resume: bool = False, timeout: float = 900) -> Results:
    """Run a scene by ``forming run`` on ``count`` ranks."""
    path = scene_file(text, folder)
    words = ["mpirun", "-n", str(count), sys.executable, "-m", "fenics_forming", "run", str(path), "--out",
             str(folder), "--quiet", *(f"--set={change}" for change in changes), *(["--resume"] if resume else [])]
    done = subprocess.run(words, capture_output=True, text=True, timeout=timeout, env=os.environ)
    assert done.returncode == 0, done.stderr[-2000:]
    return Results.read(folder)


def scale(name: str, values: np.ndarray) -> float:
    """What a difference counts against: relative numbers and lengths against one, the rest against their largest."""
    by_one = name.startswith(("volume_error", "power_imbalance", "heat_imbalance", "energy_imbalance")) or \
        name.endswith(("_x_mm", "_y_mm", "_z_mm", "_r_mm"))
    return 1.0 if by_one else float(np.abs(values).max()) or 1.0


def same(one, other, *, but=("wall_s",), within: float = ROUNDING) -> None:
    assert one.columns == other.columns and len(one) == len(other)
    for name in one.columns:
        if name not in but:
            a, b = one.column(name), other.column(name)
            # the imbalance is a difference of large powers: what the Newton leaves of it varies with rounding
            bound = 1e-5 if name == "power_imbalance" else within
            assert np.abs(a - b).max() <= bound * scale(name, a), (name, a, b)


CASES = {"billet": (BILLET, COARSE_BILLET), "ring": (RING, COARSE_RING), "punches": (PUNCHES, ()), "cube": (CUBE, ())}


@pytest.mark.parametrize("case", swept(["billet", "cube"], ["ring", "punches"]))
def test_two_ranks_find_what_one_finds(case, tmp_path):
    text, changes = CASES[case]
    one = run(text, tmp_path / "one", *changes).results
    two = on_ranks(2, text, tmp_path / "two", *changes)
    same(one.history, two.history)
    assert two.summary["ranks"] == 2 and len(two.frames) == len(one.frames)


RENEWED = {
    "ring": (RING, ("workpieces.ring.mesh_size='1 mm'", "workpieces.ring.remesh.every=4", "steps.stroke='0.1 mm'",
                    "stop.stroke='1.2 mm'", "tools.upper.friction.factor=0.5")),
    "extrusion": (EXTRUSION, ("steps.stroke='0.2 mm'", "stop.stroke='2.4 mm'")),
}


@pytest.mark.parametrize("case", swept(["ring"], ["extrusion"]))
def test_a_run_that_renews_its_mesh_does_so_alike_on_two_ranks(case, tmp_path):
    """What makes the mesh sees the whole body on one rank, and not the last digits, which depend on the ranks.

    In the ring sides fold over onto the die, and land there at remeshings. The inside of the extruded bar offers engines
    choices that are equal but for rounding: taken by it, forces differed by 1e-3 from the second remeshing on.
    """
    text, changes = RENEWED[case]
    one = run(text, tmp_path / "one", *changes).results
    two = on_ranks(2, text, tmp_path / "two", *changes)
    same(one.history, two.history)
    assert len(one.summary["remeshed"]) == len(two.summary["remeshed"]) >= 2
    for a, b in zip(one.summary["remeshed"], two.summary["remeshed"], strict=True):
        assert (a["step"], a["cells"], a["reason"]) == (b["step"], b["cells"], b["reason"])


def test_sub_steps_carry_nodes_from_the_part_of_one_rank_into_that_of_another(tmp_path):
    """The frozen field is whole on every rank; turned by the local spin, and with the places of the step before."""
    changes = ("process.shifting={ scheme = 'substeps', rule = 'midpoint', rotation = true }", "stop.stroke='0.2 mm'")
    one = run(BLOCK, tmp_path / "one", *changes).results
    two = on_ranks(2, BLOCK, tmp_path / "two", *changes)
    same(one.history, two.history)


@pytest.mark.long
def test_rank_without_contact_and_without_mirror_plane(tmp_path):
    """A slender block on three ranks: the middle one touches no tool at all, two of them have no fixed velocity."""
    changes = ("workpieces.block.shape={ kind = 'rectangle', from = [0, 0], to = [1, 6] }",
               "workpieces.block.symmetry=['x']", "workpieces.block.mesh_size=0.5", "tools.upper.shape.point=[0, 6]",
               "stop.stroke='0.2 mm'")
    one = run(BLOCK, tmp_path / "one", *changes).results
    three = on_ranks(3, BLOCK, tmp_path / "three", *changes)
    same(one.history, three.history)


def test_rank_that_owns_no_facet_that_a_tool_may_touch(tmp_path):
    """Three ranks share the quarter ring section of 14 cells: one has neither contact facets nor fixed velocities."""
    changes = ("workpieces.ring.mesh_size=2.5", "steps.stroke=0.2", "stop.stroke=0.4")
    one = run(RING, tmp_path / "one", *changes).results
    three = on_ranks(3, RING, tmp_path / "three", *changes)
    same(one.history, three.history)


def test_failure_ends_every_rank(tmp_path):
    """All ranks find the same error: exit code 1 and one sentence, not ranks that wait for each other."""
    path = scene_file(BLOCK, tmp_path)
    done = subprocess.run(["mpirun", "-n", "2", sys.executable, "-m", "fenics_forming", "run", str(path), "--out",
                           str(tmp_path), "--quiet", "--set=solver.max_iterations=2"],
                          capture_output=True, text=True, timeout=900, env=os.environ)
    assert done.returncode == 1
    assert done.stderr.count("the run failed: ") == 1
    assert Results.read(tmp_path).summary["stopped"].startswith("failed")


def test_unforeseen_error_on_one_rank_ends_all(tmp_path):
    """The others are in the middle of a reduction and would wait for ever: all are aborted, with the traceback."""
    script = ("import sys\nfrom mpi4py import MPI\nfrom fenics_forming import cli\n"
              "from fenics_forming.simulation.stepping import Stepper\n"
              "def broken(*a):\n    raise ZeroDivisionError('not foreseen')\n"
              "if MPI.COMM_WORLD.rank == 1:\n    Stepper.advance = broken\n"
              "sys.exit(cli.main(sys.argv[1:]))")
    done = subprocess.run(["mpirun", "-n", "2", sys.executable, "-c", script, "run", str(scene_file(BLOCK, tmp_path)),
                           "--out", str(tmp_path), "--quiet"], capture_output=True, text=True, timeout=900, env=os.environ)
    assert done.returncode != 0 and "ZeroDivisionError: not foreseen" in done.stderr


def test_iterations_find_the_same_on_three_ranks(tmp_path):
    """The coarse level is solved in an order of its own, so the stopped iterations differ by rounding only."""
    changes = ("solver.linear='iterative'", "workpieces.cube.mesh_size='0.7 mm'", "stop.stroke='0.2 mm'")
    one = run(CUBE, tmp_path / "one", *changes).results
    three = on_ranks(3, CUBE, tmp_path / "three", *changes)
    same(one.history, three.history)
    assert one.summary["linear_solver"] == three.summary["linear_solver"]
    assert one.summary["linear_solver"]["kind"] == "iterative" and len(three.summary["peak_memory_MB"]) == 3


BALL = """
geometry = "3d"
solver = { linear = "iterative" }
steps = { stroke = "0.1 mm" }
stop = { stroke = "0.1 mm" }

[materials.metal]
flow_stress = { law = "norton_hoff", K = "100 MPa", m = 0.12 }

[workpieces.block]
shape = { kind = "box", from = [0, 0, 0], to = [20, 20, 20] }
symmetry = ["x", "y"]
material = "metal"
mesh_size = "6 mm"

[tools.base]
shape = { kind = "plane", point = [0, 0, 0], normal = [0, 0, 1] }

[tools.ball]
shape = { kind = "sphere", centre = [0, 0, 26], radius = 6 }
drive = { kind = "speed", velocity = [0, 0, "-1 mm/s"] }
"""


def test_contact_that_opens_as_a_whole_does_so_alike_on_two_ranks(tmp_path):
    """The first increment under a ball that touches in a point pulls itself off: nothing presses, and rounding decided what
    of the base was closed next (forces 1.4e-7 apart, strains 2.1e-6, 73 Krylov iterations for nothing)."""
    one = run(BALL, tmp_path / "one").results
    two = on_ranks(2, BALL, tmp_path / "two")
    same(one.history, two.history, within=1e-10)
    assert one.summary["linear_solver"] == two.summary["linear_solver"]
    solver = one.summary["linear_solver"]
    assert solver["krylov iterations"] <= 10 * solver["solves"]


STACK = """
geometry = "3d"
solver = { linear = "iterative" }
steps = { stroke = "0.1 mm" }
stop = { stroke = "0.1 mm" }

[materials.metal]
flow_stress = { law = "linear", initial = "100 MPa", hardening = "50 MPa" }

[workpieces.low]
shape = { kind = "box", from = [0, 0, 0], to = [4, 4, 2] }
material = "metal"
symmetry = ["x", "y", "z"]
mesh_size = "1.5 mm"

[workpieces.high]
shape = { kind = "box", from = [0, 0, 2], to = [3, 3, 4] }
material = "metal"
symmetry = ["x", "y"]
mesh_size = "1.2 mm"

[[contacts]]
between = ["low", "high"]
friction = { law = "siebel", factor = 0.3 }

[tools.upper]
shape = { kind = "plane", point = [0, 0, 4], normal = [0, 0, -1] }
drive = { kind = "speed", velocity = [0, 0, "-1 mm/s"] }
friction = { law = "siebel", factor = 0.3 }
"""


def test_iterations_find_the_same_for_two_bodies_on_three_ranks(tmp_path):
    """Where two bodies meet their vertices lie in the same places, and the order of all must still be one."""
    one = run(STACK, tmp_path / "one").results
    three = on_ranks(3, STACK, tmp_path / "three")
    same(one.history, three.history)
    assert one.summary["linear_solver"] == three.summary["linear_solver"]
    directly = run(STACK, tmp_path / "direct", "solver.linear='direct'").results
    for name in ("force_upper_N", "contact_force_low_high_N"):      # Newton stops at changes of 2e-3
        np.testing.assert_allclose(one.history.column(name), directly.history.column(name), rtol=1e-3)
