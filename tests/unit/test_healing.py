"""What a remeshing mends of a plane boundary: folds where it crosses itself, sides of inverted cells, hovering sides."""

import numpy as np
import pytest

from fenics_forming.errors import MeshError
from fenics_forming.physics import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.remeshing import BodyArrays, Landing, remesh
from fenics_forming.physics.remeshing.crossing import crossings
from fenics_forming.physics.remeshing.healing import bridged, healed
from fenics_forming.physics.remeshing.landing import landed
from fenics_forming.physics.remeshing.quality import overturned, scaled_jacobian


def loop_of(points, middles=None):
    """Sides from each point to the next, straight where no middle is given."""
    points = np.asarray(points, float)
    n = len(points)
    mids = 0.5 * (points + np.roll(points, -1, axis=0))
    for k, middle in (middles or {}).items():
        mids[k] = middle
    number = np.arange(n)
    return np.concatenate([points, mids]), np.stack([number, np.roll(number, -1), n + number], axis=1)


def area(x, loop):
    """Of the polygon of starts and middles."""
    a = x[loop[:, [0, 2]].ravel()]
    b = np.roll(a, -1, axis=0)
    return 0.5 * float((a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]).sum())


def is_closed(loop):
    return np.array_equal(loop[:, 1], np.roll(loop[:, 0], -1))


def crosses(x, loop):
    a = x[loop[:, [0, 2]].ravel()]
    return len(crossings(a, np.roll(a, -1, axis=0))[0]) > 0


# ---------------------------------------------------------------------- folds
# a unit square in steps of 0.1, whose right side has folded into the body: the walls of a notch have overlapped
SQUARE = [(x, 0) for x in np.arange(0, 1, 0.1)], [(1, y) for y in np.arange(0, 1, 0.1)], \
    [(x, 1) for x in np.arange(1, 0, -0.1)], [(0, y) for y in np.arange(1, 0, -0.1)]
FOLD = [(1, 0), (1, 0.1), (1, 0.2), (1, 0.3), (1, 0.4), (0.98, 0.52), (0.9, 0.56), (0.88, 0.5), (0.9, 0.44), (0.98, 0.48),
        (1, 0.6), (1, 0.7), (1, 0.8), (1, 0.9)]


def test_a_fold_is_cut_off_where_the_boundary_crosses_itself():
    x, loop = loop_of([*SQUARE[0], *FOLD, *SQUARE[2], *SQUARE[3]])
    labels = np.where(x[loop[:, 2], 0] > 0.85, 0, 7)
    assert crosses(x, loop)
    points, mended, kinds, places = healed(x, loop, labels)
    assert is_closed(mended) and not crosses(points, mended) and len(kinds) == len(mended)
    assert np.array_equal(points[:len(x)], x), "new points are appended, none is moved"
    assert len(places) == 1 and np.linalg.norm(places[0] - (0.985, 0.5)) < 0.03
    # what is lost is the overlap: the square with a dent of the depth of the crossing, 0.2 wide
    assert area(points, mended) == pytest.approx(1.0, abs=0.5 * 0.2 * 0.04)
    far = x[loop[:, 2], 0] < 0.8
    kept = {tuple(side) for side in mended}
    assert all(tuple(side) in kept for side in loop[far]), "far from the fold nothing changes"


def test_a_boundary_without_folds_is_left_alone():
    x, loop = loop_of([*SQUARE[0], *SQUARE[1], *SQUARE[2], *SQUARE[3]])
    points, mended, kinds, places = healed(x, loop, np.zeros(len(loop), int))
    assert points is x and mended is loop and places == []


def test_two_folds_are_both_cut_off():
    other = [(1 - a, 1 - b) for a, b in FOLD]
    x, loop = loop_of([*SQUARE[0], *FOLD, *SQUARE[2], (0, 1), *other[1:]])
    points, mended, _, places = healed(x, loop, np.zeros(len(loop), int))
    assert len(places) == 2 and is_closed(mended) and not crosses(points, mended)


def test_a_body_that_is_tangled_as_a_whole_is_refused():
    eight = [(np.sin(t), np.sin(2 * t)) for t in np.arange(0.05, 2 * np.pi, 0.1)]
    x, loop = loop_of(eight)
    with pytest.raises(MeshError, match="crosses itself at"):
        healed(x, loop, np.zeros(len(loop), int))


# ---------------------------------------------------------------------- notches
def wide(points):
    return np.full(len(points), 0.15)


def test_a_notch_narrower_than_the_mesh_is_filled_and_a_wider_one_stays():
    walls = [(1, 0), (1, 0.2), (0.7, 0.25), (1, 0.3), (1, 0.5), (0.7, 0.6), (1, 0.7), (1, 0.9)]      # 0.1 and 0.2 wide
    x, loop = loop_of([*SQUARE[0], *walls, *SQUARE[2], *SQUARE[3]])
    points, mended, kinds, places = bridged(x, loop, np.zeros(len(loop), int), wide)
    assert is_closed(mended) and len(kinds) == len(mended) == len(loop) - 1
    assert np.array_equal(places, [[1, 0.25]])
    assert area(points, mended) == pytest.approx(1 - 0.5 * 0.2 * 0.3, rel=1e-12)


def test_edges_fins_and_walls_on_tools_are_no_notches():
    fin = [(1, 0), (1, 0.2), (1.3, 0.25), (1, 0.3), (1, 0.9)]
    groove = [(1, 1), (0.6, 1), (0.6, 0.9), (0.5, 0.9), (0.5, 1)]       # pressed: the tool has made it
    x, loop = loop_of([*SQUARE[0], *fin, *groove, *SQUARE[3]])
    labels = np.where(x[loop[:, 2], 1] > 0.85, 1, 0)
    points, mended, _, places = bridged(x, loop, labels, wide)
    assert points is x and mended is loop and places == []


def test_the_undercut_of_a_lip_below_a_tool_is_filled():
    """The free surface runs back below the end of the contact: a wedge that cells would have to fill."""
    lip = [(1, 0), (1, 0.93), (0.95, 0.97), (1, 1), (0.5, 1)]
    x, loop = loop_of([*SQUARE[0], *lip, *SQUARE[3]])
    labels = np.where(x[loop[:, 2], 1] == 1, 1, 0)
    points, mended, kinds, places = bridged(x, loop, labels, wide)
    assert len(places) == 1 and area(points, mended) == pytest.approx(1, rel=1e-12)
    assert (points[mended[kinds == 1], 1] == 1).all()


# ---------------------------------------------------------------------- inverted cells
@pytest.mark.parametrize("pushed", [0.15, 0.3])
def test_sides_behind_inverted_cells_are_no_pinch(pushed):
    """A vertex of the surface pushed through its cells: their sides seem to run the wrong way."""
    nodes = Nodes(meshing.rectangle((0, 0), (1, 1), (10, 10)))
    x, cells = nodes.x.copy(), nodes.cells.copy()
    vertex = np.argmin(np.linalg.norm(x - (1.0, 0.5), axis=1))
    beside = cells[(cells[:, :3] == vertex).any(axis=1)]
    x[vertex, 0] -= pushed
    for cell in beside:       # mid-nodes go half-way along
        for k, (a, b) in enumerate(((1, 2), (0, 2), (0, 1))):
            x[cell[3 + k]] = 0.5 * (x[cell[a]] + x[cell[b]])
    assert overturned(nodes.x, x, cells).any(), "the case is what it is meant to be"
    body = BodyArrays(x, cells)
    new = remesh(body, np.zeros(len(body.sides), int), lambda p: np.full(len(p), 0.1), least=0.1)
    assert scaled_jacobian(new.x, new.cells).min() > 0
    assert new.x[:, 0].max() == pytest.approx(1.0, abs=0.02)


# ---------------------------------------------------------------------- landing
def above(points):
    """A flat tool above y = 1."""
    return 1.0 - points[:, 1], np.tile([0.0, -1.0], (len(points), 1))


LANDING = Landing({1: above}, lambda points: np.full(len(points), 0.02), lambda points: np.full(len(points), 0.1), 1e-6)


def upper(points, middles=None, pressed=1.0):
    """A block up to y = 1, body on the left, whose upper side is ``points`` from the right to the left; sides on the tool
    that begin at or beyond x = ``pressed`` are labelled so."""
    x, loop = loop_of([(0, 0), (3, 0), *points], middles)
    on = (abs(x[loop, 1] - 1.0) < 1e-12).all(axis=1)
    return x, loop, np.where(on & (x[loop[:, 0], 0] <= pressed), 1, 0)


def test_a_side_that_rolls_on_lands_up_to_where_it_is_low():
    """Parabola, tangent to the tool: its middle is at a quarter of the height of its end."""
    x, loop, labels = upper([(3, 0.5), (2.2, 0.94), (2, 1), (1, 1), (0, 1)], {3: (2.1, 0.985)}, pressed=2.0)
    points, mended, kinds = landed(x, loop, labels, LANDING)
    assert is_closed(mended)
    end = points[mended[kinds == 1][:, :2]].reshape(-1, 2)
    assert end[:, 0].max() == 2.1 and (points[mended[kinds == 1], 1] == 1.0).all()
    free = mended[kinds == 0]
    assert [2.2, 0.94] in points[free[:, 1]].tolist(), "the other half stays where it is"
    # a quarter of the way along the parabola, whose middle alone has gone up
    assert np.abs(points[free[:, 2]] - (2.15, 0.75 * 1 + 0.375 * 0.94 - 0.125 * 1)).sum(axis=1).min() < 1e-12


def test_what_hovers_beside_no_contact_stays_free():
    x, loop, labels = upper([(3, 0.5), (2, 0.99), (1, 0.99), (0, 0.5)])
    points, mended, kinds = landed(x, loop, labels, LANDING)
    assert points is x and mended is loop and (kinds == 0).all()


def test_a_shallow_pocket_is_closed_and_a_deep_one_stays():
    flat = [(3, 0.5), (2.8, 1), (2.4, 1), (2.2, 0.99), (2, 0.985), (1.8, 1), (1.4, 1), (1.2, 0.9), (1, 1), (0, 1)]
    x, loop, labels = upper(flat, pressed=3)
    points, mended, kinds = landed(x, loop, labels, LANDING)
    right = points[mended[:, 2], 0] > 1.4
    assert (kinds[right & (points[mended[:, 2], 1] > 0.9)] == 1).all()
    assert [1.2, 0.9] in points[mended[kinds == 0][:, 0]].tolist(), "a mesh can resolve that one"


def test_a_pocket_too_narrow_for_the_mesh_is_closed_however_deep():
    flat = [(3, 0.5), (2.8, 1), (2.4, 1), (2.0, 1), (1.98, 0.7), (1.96, 1), (1.5, 1), (1, 1), (0, 1)]
    x, loop, labels = upper(flat, pressed=3)
    points, mended, kinds = landed(x, loop, labels, LANDING)
    assert area(points, mended) == pytest.approx(area(x, loop) + 0.5 * 0.04 * 0.3, rel=1e-12)
    assert is_closed(mended) and points[mended[kinds == 1], 1].min() == 1.0


def test_a_lip_lands_up_to_its_tip_only():
    """Beyond the tip the surface runs back below: there is nothing to lay on the tool."""
    x, loop, labels = upper([(3, 0.5), (2.2, 0.9), (2.25, 0.985), (2.3, 0.99), (2, 1), (1, 1), (0, 1)], pressed=2)
    points, mended, kinds = landed(x, loop, labels, LANDING)
    held = points[mended[kinds == 1][:, :2]].reshape(-1, 2)
    assert held[:, 0].max() == 2.3 and is_closed(mended) and not crosses(points, mended)
    free = mended[kinds == 0]
    assert [2.25, 0.985] not in points[free[:, 1]].tolist(), "what lies behind the tip is bridged as far as a mesh resolves"
    assert [2.2, 0.9] in points[free[:, 0]].tolist() or [2.2, 0.9] in points[free[:, 1]].tolist()


def test_a_crumpled_pocket_is_laid_flat():
    """Its points do not follow one another along the tool: those that do not go forward are left out."""
    flat = [(3, 0.5), (2.8, 1), (2.4, 1), (2.1, 0.995), (2.2, 0.985), (1.9, 0.99), (1.8, 1), (1, 1), (0, 1)]
    x, loop, labels = upper(flat, pressed=3)
    points, mended, kinds = landed(x, loop, labels, LANDING)
    top = points[mended[kinds == 1][:, 0]]
    assert (np.diff(top[:, 0]) < 0).all() and (top[:, 1] == 1).all()
    assert top[:, 0].max() == 2.8 and points[mended[kinds == 1][:, 1], 0].min() == 0.0
