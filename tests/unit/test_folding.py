"""Folds: a slot that closes is found as soon as it is shut, at its place, and nothing else is taken for one."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming import kinematics, meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.process.folding import FoldFinder
from fenics_forming.process.volume import FreeSurface
from fenics_forming.results.recording.folds import FoldRecord

SLOT = 0.5     # mm, width at the start


def slotted(dim, size, mirror=False):
    """A block of 4 x 4 (x 2) mm with a slot from its top down to y = 1; with a mirror plane its right half."""
    if dim == 2:
        left = [(0, 0)] if mirror else [(-2, 0)]
        inner = [(SLOT / 2, 4), (SLOT / 2, 1)] + ([(0, 1)] if mirror else [(-SLOT / 2, 1), (-SLOT / 2, 4), (-2, 4)])
        nodes = Nodes(meshing.polygon([*left, (2, 0), (2, 4), *inner], size))
        return nodes, FreeSurface.of_mesh(nodes, kinematics.PLANE_STRAIN, {0: 0.0} if mirror else {})

    def build(gmsh):
        occ = gmsh.model.occ
        block, slot = occ.addBox(-2, 0, 0, 4, 4, 2), occ.addBox(-SLOT / 2, 1, -1, SLOT, 5, 4)
        occ.cut([(3, block)], [(3, slot)])
        occ.synchronize()

    nodes = Nodes(meshing.generate(build, 3, size))
    return nodes, FreeSurface.of_mesh(nodes, kinematics.THREE_DIMENSIONAL, {})


def close(nodes, by):
    """Bring the tips of the legs nearer by ``by``, mm, and the rest in proportion to the height above the ground."""
    up = np.clip(nodes.x[:, 1] - 1, 0, None) / 3
    nodes.x[:, 0] -= np.sign(nodes.x[:, 0]) * up * by / 2


BODIES = pytest.mark.parametrize(("dim", "size"), [(2, 0.5), (2, 0.15), (3, 0.5)])


@BODIES
@pytest.mark.parametrize("by", [0.0, 0.4, 0.49])
def test_open_slot_is_no_fold(dim, size, by):
    nodes, free = slotted(dim, size)
    close(nodes, by)
    found = FoldFinder(free, nodes.cells).find(nodes.x)
    assert found.places.shape == (0, dim) and found.depths.shape == (0,)


@BODIES
def test_slot_that_is_just_shut_touches(dim, size):
    nodes, free = slotted(dim, size)
    close(nodes, SLOT)
    found = FoldFinder(free, nodes.cells).find(nodes.x)
    assert len(found.depths) == 1 and found.depths[0] == 0
    assert found.places[0, :2] == pytest.approx((0, 4), abs=1e-9)


@BODIES
@pytest.mark.parametrize("over", [0.05, 0.1])
def test_crossing_legs_are_found_where_and_as_deep_as_they_cross(dim, size, over):
    """The faces are flat and lean against one another by a few degrees: a node at the height y is deeper than the other
    face by the overlap there, and the deepest that can be found lies within two elements of the tips."""
    nodes, free = slotted(dim, size)
    close(nodes, SLOT + over)
    found = FoldFinder(free, nodes.cells).find(nodes.x)
    assert len(found.depths) == 1
    x, y = found.places[0, :2]
    assert 0 < found.depths[0] <= over * 1.01
    assert y > 4 - 2 * size
    overlap = (SLOT + over) * (y - 1) / 3 - SLOT
    assert abs(x) == pytest.approx(overlap / 2, rel=1e-6)
    assert found.depths[0] == pytest.approx(overlap, rel=0.02)      # the cosine of the lean, in 3-D twice


def test_half_a_slot_folds_onto_its_mirror_image():
    nodes, free = slotted(2, 0.3, mirror=True)
    finder = FoldFinder(free, nodes.cells)
    close(nodes, 0.49)
    assert len(finder.find(nodes.x).depths) == 0
    close(nodes, 0.11)
    found = finder.find(nodes.x)
    assert found.depths == pytest.approx([0.05], rel=1e-9) and found.places[0] == pytest.approx((-0.05, 4))


@pytest.mark.parametrize("thickness", [0.4, 0.05])
def test_thin_body_does_not_touch_itself(thickness):
    """The two faces of a sheet are near and opposed, but the body lies between them."""
    nodes = Nodes(meshing.rectangle((0, 0), (4, thickness), (10, 2)))
    nodes.x[:, 1] += 0.1 * nodes.x[:, 0] ** 2
    free = FreeSurface.of_mesh(nodes, kinematics.PLANE_STRAIN, {})
    assert len(FoldFinder(free, nodes.cells).find(nodes.x).depths) == 0


def test_sharp_edges_and_notches_are_no_folds():
    """A star: its tips are sharper, and its notches narrower, the longer its rays are."""
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    radius = np.where(np.arange(16) % 2, 0.8, 3.0)
    nodes = Nodes(meshing.polygon(np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1), 0.3))
    free = FreeSurface.of_mesh(nodes, kinematics.PLANE_STRAIN, {})
    assert len(FoldFinder(free, nodes.cells).find(nodes.x).depths) == 0


def test_axis_and_mirror_planes_of_a_whole_body_are_no_folds():
    nodes = Nodes(meshing.rectangle((0, 0), (2, 1), (8, 4)))
    free = FreeSurface.of_mesh(nodes, kinematics.AXISYMMETRIC, {0: 0.0, 1: 0.0})
    assert len(FoldFinder(free, nodes.cells).find(nodes.x).depths) == 0


# ---------------------------------------------------------------------- in a run
class Lying:
    """A body as a record of folds sees it."""

    def __init__(self, nodes, free):
        self.nodes, self.free_surface, self.x, self.size = nodes, free, nodes.x, 4.0

    def skins(self):
        return [(self.free_surface, self.nodes.cells)]


def test_record_tells_a_fold_once_and_keeps_its_greatest_depth():
    nodes, free = slotted(2, 0.3)
    record, body = FoldRecord(), Lying(nodes, free)
    close(nodes, 0.55)
    record.look(body, 4)
    assert record.folds == [], "not searched in this step"
    record.look(body, 5)
    assert len(record.news()) == 1 and record.folds[0]["step"] == 5
    first = dict(record.folds[0])
    close(nodes, 0.05)
    record.look(body, 10)
    assert record.news() == [] and len(record.folds) == 1
    assert record.folds[0]["depth_mm"] > first["depth_mm"] and record.folds[0]["place"] == first["place"]
    resumed = FoldRecord()
    resumed.remember(record.memory())
    resumed.look(body, 15)
    assert resumed.folds == record.folds and resumed.news() == []
    assert "folds onto itself at (" in resumed.doubts()[0] and "step 5; self-contact is not modelled" in resumed.doubts()[0]


def legs(stroke, **changes):
    """Half of a U whose leg is pushed at its tip towards the mirror plane by a round punch."""
    outline = [[0, 0], [3, 0], [3, 8], [1, 8], [1, 3], [0, 3]]
    workpiece = {"shape": {"kind": "polygon", "points": outline}, "material": "lead", "mesh_size": 0.8, "symmetry": ["x"]}
    return ff.Scene(**{
        "geometry": "plane_strain", "materials": {"lead": {"flow_stress": {"law": "constant", "value": 100}}},
        "workpieces": {"u": workpiece},
        "tools": {"punch": {"shape": {"kind": "circle", "centre": [5, 7.5], "radius": 2},
                            "drive": {"kind": "speed", "velocity": [-1, 0]}},
                  "ground": {"shape": {"kind": "plane", "point": [0, 0], "normal": [0, 1]}}},
        "steps": {"stroke": 0.1, "scheme": "etd2"}, "stop": {"stroke": stroke},
        "output": {"fields_every": 0, "checkpoint_every": 0}, **changes})


def test_run_reports_the_fold_that_it_makes():
    """The tip is 1 mm from the mirror plane; it arrives there when the punch has gone about as far."""
    from fenics_forming.results.progress import Silent

    class Ear(Silent):
        def __init__(self):
            self.notes = []

        def note(self, text):
            self.notes.append(text)

    ear = Ear()
    results = ff.simulate(legs(1.25), observer=ear)
    fold, = results.summary["folds"]
    assert fold["depth_mm"] > 0 and fold["place"][1] > 6 and fold["place"][0] < 0.05
    sentence, = [w for w in results.summary["warnings"] if "folds onto itself" in w]
    assert f"step {fold['step']}" in sentence and sentence in ear.notes
    assert ff.simulate(legs(0.5)).summary["folds"] == []


def test_bulging_against_tools_is_no_fold():
    """A block upset by half between rough plates: its sides fold down onto them, which is what they should do."""
    scene = ff.Scene(**{
        "geometry": "plane_strain", "materials": {"lead": {"flow_stress": {"law": "constant", "value": 100}}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [5, 5]}, "material": "lead",
                             "mesh_size": 0.8, "symmetry": ["x", "y"]}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, 5], "normal": [0, -1]},
                            "drive": {"kind": "speed", "velocity": [0, -1]}, "friction": {"law": "sticking"}}},
        "steps": {"stroke": 0.1, "scheme": "etd2"}, "stop": {"stroke": 2.5},
        "output": {"fields_every": 0, "checkpoint_every": 0}})
    summary = ff.simulate(scene).summary
    assert summary["folds"] == [] and summary["stopped"].startswith("stroke")


@pytest.mark.mpi
def test_two_ranks_find_the_same_folds():
    program = textwrap.dedent("""
        from mpi4py import MPI
        from fenics_forming.process.folding import FoldFinder
        from tests.unit.test_folding import close, slotted
        for dim, size, by in ((2, 0.2, 0.58), (2, 0.2, 0.4), (3, 0.6, 0.6)):
            nodes, free = slotted(dim, size)
            close(nodes, by)
            found = FoldFinder(free, nodes.cells).find(nodes.x)
            everywhere = MPI.COMM_WORLD.allgather((found.places.tolist(), found.depths.tolist()))
            assert all(other == everywhere[0] for other in everywhere)
            if MPI.COMM_WORLD.rank == 0:
                print(len(found.depths), *found.places.ravel().round(9), *found.depths.round(9))
        """)
    answers = []
    for launcher in ([], ["mpirun", "-n", "2"], ["mpirun", "-n", "3"]):
        done = subprocess.run([*launcher, sys.executable, "-c", program], capture_output=True, text=True, timeout=900)
        assert done.returncode == 0, done.stderr[-2000:]
        answers.append(np.array(done.stdout.split(), float))
    assert answers[0][0] == 1 and len(answers[0]) == 4 + 1 + 5
    for other in answers[1:]:
        assert other == pytest.approx(answers[0], abs=1e-9)
