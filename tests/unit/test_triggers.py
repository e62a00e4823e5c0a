"""When a mesh is renewed: each reason on a body that gives no other."""

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.simulation import Simulation


def body_and_triggers(**remesh):
    """A block of 10 x 10 mm under a plate and its triggers."""
    scene = ff.Scene(
        geometry="plane_strain", materials={"m": {"flow_stress": {"law": "constant", "value": 100}}},
        workpieces={"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 10]}, "material": "m",
                          "symmetry": ["x", "y"], "mesh_size": 2, "remesh": {"least_steps": 3, **remesh}}},
        tools={"upper": {"shape": {"kind": "plane", "point": [0, 10], "normal": [0, -1]},
                         "drive": {"kind": "speed", "velocity": [0, -1]}},
               "die": {"shape": {"kind": "polyline", "points": [[10.5, 0], [10.5, 10]]}}},
        steps={"stroke": 0.1}, stop={"stroke": 1})
    run = Simulation(scene)
    return run.body, run.keeper.triggers


def still(body):
    return np.zeros_like(body.x)


def test_good_mesh_stays():
    body, triggers = body_and_triggers()
    assert triggers.reason(body, still(body), 1.0, 100) is None


def test_velocities_are_looked_at_for_the_whole_next_step():
    """A shear of three turns good triangles into slivers; half of the step would not."""
    body, triggers = body_and_triggers(neighbour_ratio=100)
    shear = np.stack([3 * body.x[:, 1], 0 * body.x[:, 1]], axis=1)
    assert triggers.reason(body, shear, 0.1, 100) is None
    assert triggers.reason(body, shear, 1.0, 100).startswith("quality")


def test_cell_that_would_be_inverted_is_seen():
    body, triggers = body_and_triggers()
    inner = np.argmin(np.linalg.norm(body.x - 5.0, axis=1))
    velocity = still(body)
    velocity[inner] = [9.0, 0.0]
    assert triggers.reason(body, velocity, 1.0, 100) == "a cell would be inverted"


def test_neighbours_of_unlike_size():
    body, triggers = body_and_triggers(neighbour_ratio=1.02)
    assert triggers.reason(body, still(body), 1.0, 100).endswith("times as large as its neighbour")


def test_step_count_and_least_distance():
    body, triggers = body_and_triggers(every=5, neighbour_ratio=1.02)
    assert triggers.reason(body, still(body), 1.0, 2) is None             # 1.02 is exceeded, but two steps are too few
    assert triggers.reason(body, still(body), 1.0, 5) == "5 steps have passed"


def test_side_that_sinks_into_a_tool():
    """The side has moved into the upright wall by an eighth of its length."""
    body, triggers = body_and_triggers()
    body.x[np.isclose(body.x[:, 0], 10.0), 0] += 0.75
    assert triggers.reason(body, still(body), 1.0, 100).startswith("a side has sunk into 'die'")


@pytest.mark.parametrize("best, expected", [(2.0, "quality"), (0.5, None)])
def test_mesh_that_is_poor_from_the_start_is_renewed_when_it_has_become_worse(best, expected):
    """After a remeshing that gave little more than the limit, the limit is 0.7 of what it gave."""
    body, triggers = body_and_triggers(min_quality=0.99)
    triggers.best = best
    found = triggers.reason(body, still(body), 1.0, 100)
    assert (found is None) if expected is None else found.startswith(expected)
