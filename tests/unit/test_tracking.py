"""Material points stay on the material: in straight and curved cells, through new meshes, on any number of ranks."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

from fenics_forming import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.tracking import MaterialPoints

DIMENSIONS = pytest.mark.parametrize("dim", [2, 3])


def regular(dim, n=3):
    if dim == 2:
        return Nodes(meshing.rectangle((0, 0), (2, 1), (n, n)))
    return Nodes(meshing.box((0, 0, 0), (2, 1, 1), (n, n, n)))


def quadratic_map(x):
    """A smooth map whose components are quadratic: P2 geometry carries it exactly."""
    moved = x.copy()
    moved[:, 0] += 0.1 * x[:, -1] ** 2 + 0.05 * x[:, 0] * x[:, -1]
    moved[:, -1] += 0.2 * x[:, 0] - 0.03 * x[:, 0] ** 2
    return moved


def quarter_ring():
    """Four curved sides of 22.5 degrees on the circle of radius 1."""
    nodes = Nodes(meshing.rectangle((0.5, 0), (1, np.pi / 2), (2, 4)))
    r, turn = nodes.x.T.copy()
    nodes.x[:] = np.stack([r * np.cos(turn), r * np.sin(turn)], axis=1)
    return nodes


PLACES = {2: {"inside": (0.9, 0.37), "corner": (2, 1), "side": (0.61, 0), "vertex": (2 / 3, 1 / 3), "edge": (1 / 3, 0)},
          3: {"inside": (0.9, 0.37, 0.21), "corner": (2, 1, 1), "face": (0.61, 0, 0.3), "vertex": (2 / 3, 1 / 3, 1 / 3),
              "edge": (1 / 3, 0, 0)}}


@DIMENSIONS
def test_material_points_stay_on_the_material(dim):
    """Found where they were asked for; after a map that P2 carries exactly they are where the map takes them."""
    nodes = regular(dim)
    points = MaterialPoints(nodes, PLACES[dim])
    assert max(points.distance.values()) < 1e-14
    for name, place in points.places.items():
        assert place[0] == pytest.approx(PLACES[dim][name], abs=1e-14)
    nodes.x[:] = quadratic_map(nodes.x)
    first = points.values(nodes.x[:, 0].copy())
    for name, place in points.places.items():
        moved = quadratic_map(np.array([PLACES[dim][name]], float))
        assert place == pytest.approx(moved, abs=1e-14)
        assert first[name] == pytest.approx(moved[:, 0], abs=1e-14)


@DIMENSIONS
def test_rows_of_points_keep_their_names_order_and_shape(dim):
    nodes = regular(dim)
    row = np.linspace([0.0] * dim, [1.0] * dim, 7)
    points = MaterialPoints(nodes, {"row": row, "one": row[3], "two": row[[5, 1]]})
    found = points.values(nodes.x)
    assert list(found) == list(points.distance) == ["row", "one", "two"]
    for name, expected in {"row": row, "one": row[3:4], "two": row[[5, 1]]}.items():
        assert found[name] == pytest.approx(expected, abs=1e-14)
        assert points.values(nodes.x[:, 0].copy())[name].shape == (len(expected),)


@DIMENSIONS
def test_material_points_are_found_in_a_curved_mesh(dim):
    """The inverse of the quadratic cell map, by Newton: many places, also on curved sides."""
    nodes = regular(dim)
    before = np.random.default_rng(4).uniform(0, 1, (40, dim)) * ([2.0] + [1.0] * (dim - 1))
    before[:10, -1] = 1.0
    nodes.x[:] = quadratic_map(nodes.x)
    at = quadratic_map(before)
    assert MaterialPoints(nodes, {"p": at}).places["p"] == pytest.approx(at, abs=1e-12)


def test_points_on_the_true_circle_take_the_nearest_place_of_its_curved_sides():
    """The sides of quadratic cells lie up to h⁴ beside the circle: the points are drawn onto them, no farther."""
    nodes = quarter_ring()
    angle = np.linspace(0.05, 1.5, 13)
    at = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = MaterialPoints(nodes, {"p": at})
    assert np.linalg.norm(points.places["p"] - at, axis=1) == pytest.approx(points.distance["p"], abs=1e-15)
    # four sides of 22.5 degrees: (h/2)^4/... = 2e-4 of the radius at most
    assert 1e-6 < points.distance["p"].max() < 5e-4


def test_point_just_outside_a_flat_side_lands_at_its_foot():
    points = MaterialPoints(regular(2), {"p": (0.61, -1e-3)})
    assert points.distance["p"] == pytest.approx([1e-3], rel=1e-12)
    assert points.places["p"][0] == pytest.approx([0.61, 0], abs=1e-12)


# ---------------------------------------------------------------------- new meshes
@DIMENSIONS
def test_points_go_on_from_their_places_in_a_new_mesh(dim):
    """Half the way in one mesh, half in another: the same as all the way in one, as both carry the map exactly."""
    old, new = regular(dim, 3), regular(dim, 5)
    start = np.random.default_rng(2).uniform(0, 1, (30, dim))
    points = MaterialPoints(old, {"p": start})
    old.x[:] = quadratic_map(old.x)
    new.x[:] = quadratic_map(new.x)
    points = points.relocated(new)
    assert points.distance["p"].max() < 1e-13
    new.x[:] = 2 * new.x + 1
    assert points.places["p"] == pytest.approx(2 * quadratic_map(start) + 1, abs=1e-13)


def test_point_on_a_curved_surface_stays_on_it_through_twenty_meshes():
    """Coarse and fine sides differ by 2e-4 of the radius: a point drawn onto each in turn does not walk away."""
    coarse = quarter_ring()
    fine = Nodes(meshing.rectangle((0.5, 0), (1, np.pi / 2), (3, 7)))
    r, turn = fine.x.T.copy()
    fine.x[:] = np.stack([r * np.cos(turn), r * np.sin(turn)], axis=1)
    angle = np.linspace(0.05, 1.5, 13)
    at = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = MaterialPoints(coarse, {"p": at})
    for mesh in 10 * [fine, coarse]:
        points = points.relocated(mesh)
    x, y = points.places["p"].T
    assert np.abs(np.hypot(x, y) - 1).max() < 5e-4
    assert np.arctan2(y, x) == pytest.approx(angle, abs=5e-4)


TWO_RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_forming import meshing
    from fenics_forming.physics.nodes import Nodes
    from fenics_forming.physics.tracking import MaterialPoints
    for dim in (2, 3):
        n = 4
        def make(comm, n):
            if dim == 2:
                return Nodes(meshing.rectangle((0, 0), (2, 1), (n, n), comm))
            return Nodes(meshing.box((0, 0, 0), (2, 1, 1), (n, n, n), comm))
        high = np.array([2.0] + [1.0] * (dim - 1))
        at = np.concatenate([np.random.default_rng(0).uniform(0, 1, (50, dim)) * high, [[1.0] + [0.5] * (dim - 1), high]])
        found = []
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
            nodes, finer = make(comm, n), make(comm, n + 1)
            points = MaterialPoints(nodes, {"one": at[:1], "rest": at[1:]})
            assert points.distance["one"].max() < 1e-14 and points.distance["rest"].max() < 1e-14
            nodes.x[:, 0] += 0.1 * nodes.x[:, -1] ** 2
            finer.x[:, 0] += 0.1 * finer.x[:, -1] ** 2
            moved = at.copy()
            moved[:, 0] += 0.1 * at[:, -1] ** 2
            assert np.abs(points.places["rest"] - moved[1:]).max() < 1e-13
            points = points.relocated(finer)
            assert np.abs(points.places["one"] - moved[:1]).max() < 1e-13
            found.append(points.values(np.sin(finer.x)))
        assert all(np.abs(found[0][k] - found[1][k]).max() < 1e-13 for k in found[0]), "as on one rank"
        everywhere = MPI.COMM_WORLD.allgather(found[0]["rest"])
        assert (everywhere[0] == everywhere[1]).all(), "every rank has the same values"
"""


@pytest.mark.mpi
def test_points_are_the_same_on_two_ranks(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(textwrap.dedent(TWO_RANKS))
    run = subprocess.run(["mpirun", "-n", "2", sys.executable, script], capture_output=True, text=True, timeout=900)
    assert run.returncode == 0, run.stderr
