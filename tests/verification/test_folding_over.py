"""Rough dies to large strain with automatic remeshing: surfaces that fold over onto the die. REFERENCES.md 3.2, 3.3, 3.4.

The explicit reference of 3.2 and 3.4 gives less force for m >= 0.5 beyond half of the height than the limit load of a
parallel body that fits into its own deformed one (3.2, m = 1, 68.7 %: 133 kN; parallel cylinder of its contact radius
177 kN), although material cannot be added to a body without making it stronger. There the theorem itself is the test.
"""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from fenics_forming import read_scene
from fenics_forming.physics.remeshing import BodyArrays
from fenics_forming.scene import Scene
from fenics_forming.simulation import Simulation

DEMOS = Path(__file__).parents[2] / "demos" / "scenes"
BILLET = DEMOS / "billet_upsetting.toml"
LANDED = 0.02      # mm: the chord distance of the ring; what is nearer to the die is taken as lying on it


class Run:
    """A run, and what its shape was after each step: radii of the contact and of the mid-plane, inner and outer, mm."""

    def __init__(self, scene: Scene):
        self.simulation, self.shapes, self.notes = Simulation(scene), [], []
        self.results = self.simulation.run(observer=self)

    def started(self, *_): ...

    def finished(self, *_): ...

    def note(self, sentence):
        self.notes.append(sentence)

    def step(self, row, limited_by):
        body = self.simulation.body
        sides = BodyArrays(body.x, body.nodes.cells).sides
        on = (np.abs(body.tools[0].gap(body.x)[0]) < LANDED)[sides].all(axis=1)
        contact, middle = body.x[sides[on], 0], body.x[body.x[:, 1] < 1e-9, 0]
        self.shapes.append((contact.min(), contact.max(), middle.min(), middle.max()))

    def at(self, stroke: float) -> tuple[float, np.ndarray]:
        """Force, kN, and the four radii at a stroke, linear between steps."""
        history = self.results.history
        strokes, forces = history.column("stroke_upper_mm"), history.column("force_upper_N")
        assert strokes[-1] >= stroke * (1 - 1e-9)
        radii = np.array(self.shapes).T
        return np.interp(stroke, strokes, forces) / 1e3, np.array([np.interp(stroke, strokes, r) for r in radii])

    @property
    def jumps(self) -> np.ndarray:
        """Relative change of the force by each remeshing."""
        return np.array([after[0] / before[0] - 1 for before, after in (r.forces for r in self.simulation.keeper.records)])

    def failed(self) -> list[str]:
        return [note for note in self.notes if "new one failed" in note]


def ring(factor, *changes) -> Run:
    return Run(read_scene(DEMOS / "ring_compression.toml", set=[
        f'tools.upper.friction={{ law = "siebel", factor = {factor} }}', *changes]))


def block(inner, outer, half_height, factor, *, size, stop, step, remesh) -> Scene:
    """Upper half of a ring or cylinder of 100 MPa on its mirror plane."""
    return Scene.read({
        "geometry": "axisymmetric", "materials": {"m": {"flow_stress": {"law": "constant", "value": 100.0}}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [inner, 0], "to": [outer, half_height]},
                             "material": "m", "mesh_size": size, "symmetry": ["z"], "remesh": remesh}},
        "tools": {"upper": {"shape": {"kind": "plane", "point": [0, half_height], "normal": [0, -1]},
                            "drive": {"kind": "speed", "velocity": [0, -1]},
                            "friction": {"law": "siebel", "factor": factor}}},
        "steps": {"stroke": step}, "stop": {"stroke": stop}})


def limit_load(inner, outer, half_height, factor) -> float:
    """Of a body with parallel sides, kN; from above, 0.2 % too large at most on such a mesh (REFERENCES.md 3.1)."""
    step = 1e-4 * half_height
    first = Run(block(inner, outer, half_height, factor, size=half_height / 5, stop=step, step=step, remesh=False))
    return first.results.history.rows[0]["force_upper_N"] / 1e3


def assert_between_limit_loads(run: Run, stroke, half_height, factor):
    """The parallel body between the contact radii fits into the deformed one, which fits into that between its extremes."""
    force, (face_in, face_out, middle_in, middle_out) = run.at(stroke)
    low = limit_load(face_in, face_out, half_height - stroke, factor)
    high = limit_load(min(face_in, middle_in), max(face_out, middle_out), half_height - stroke, factor)
    # the contact ends within a side: 0.1 mm of 18 mm, 1 %; so does the accuracy of the run
    assert 0.98 * low < force < 1.01 * high, (low, force, high)


COARSE = pytest.param(("workpieces.ring.mesh_size=0.7", "steps.stroke=0.1"), id="coarse")
FULL = [pytest.param(changes, id=name, marks=pytest.mark.long) for name, changes in (
    ("scene", ()), ("fine", ("workpieces.ring.mesh_size=0.35",)), ("coarsest", ("workpieces.ring.mesh_size=1.0",)),
    ("short steps", ("steps.stroke=0.025",)), ("long steps", ("steps.stroke=0.1",)), ("etd2", ("process.shifting=etd2",)))]
meshes_and_steps = pytest.mark.parametrize("changes", [COARSE, *FULL])


# ---------------------------------------------------------------------- 3.4 ring
@meshes_and_steps
@pytest.mark.parametrize(("factor", "middle", "face", "force"), [
    (0.1, (9.8, 12.5, 13.2), (8.5, 10.5, 10.9), 118.0), (0.5, (-23.0, -32.6, -45.6), (-5.6, -13.3, -29.3), 145.1)])
def test_a_ring_follows_the_reference_to_half_its_height(factor, middle, face, force, changes):
    run = ring(factor, *changes)
    assert len(run.failed()) <= 3      # a lip of one curved side may defy a new mesh; the run goes on and tries again
    for reduction, at_middle, at_face in zip((0.295, 0.397, 0.5), middle, face, strict=True):
        contact, _, least, _ = run.at(5 * reduction)[1]
        assert 100 * (least / 7.5 - 1) == pytest.approx(at_middle, abs=2.0)
        # contact grows side by side: up to half of one of 0.35 mm besides
        assert 100 * (contact / 7.5 - 1) == pytest.approx(at_face, abs=2.0 if factor == 0.1 else 4.5)
    assert run.at(5 * 0.4897)[0] == pytest.approx(force, rel=0.03 if "1.0" in str(changes) else 0.02)


@meshes_and_steps
def test_a_ring_that_sticks_carries_what_limit_theorems_allow(changes):
    """The bore closes by 60 % of its radius; the mid-height of the coarse reference (16 x 10 cells) within 5 points."""
    run = ring(1.0, *changes)
    assert not run.failed()
    for stroke in (1.5, 2.5):
        assert_between_limit_loads(run, stroke, 5.0, 1.0)
    for reduction, at_middle in ((0.295, -23.8), (0.397, -35.6), (0.5, -56.1)):
        assert 100 * (run.at(5 * reduction)[1][2] / 7.5 - 1) == pytest.approx(at_middle, abs=5.0)
    assert abs(run.results.history.rows[-1]["volume_error_ring"]) < 1e-12


# ---------------------------------------------------------------------- 3.2 cylinders
@pytest.mark.parametrize("factor", [0.2, pytest.param(0.5, marks=pytest.mark.long), 1.0])
def test_a_cylinder_upset_by_seventy_per_cent(factor):
    run = Run(block(0, 10, 10, factor, size=1.0, stop=7.0, step=0.2, remesh=True))
    assert not run.failed()
    for reduction, radius in ((0.4949, 14.5), (0.5974, 16.14), (0.7, 18.58)):
        assert run.at(10 * reduction)[1][3] == pytest.approx(radius, rel=0.01)
    assert_between_limit_loads(run, 7.0, 10.0, factor)
    if factor == 0.2:
        for reduction, force in ((0.4821, 63.89), (0.5846, 81.49), (0.6872, 113.19)):
            assert run.at(10 * reduction)[0] == pytest.approx(force, rel=0.03)


# ---------------------------------------------------------------------- 3.3 billet
@pytest.mark.parametrize(("changes", "within"), [
    ((), 0.015),                            # 1 mm, steps of 0.25 mm: at the end 5 % of the height
    (("workpieces.billet.mesh_size=1.2",), 0.015),
    pytest.param(("workpieces.billet.mesh_size=0.7", "steps.stroke=0.1"), 0.012, marks=pytest.mark.long)])
def test_the_sticking_billet_to_seventy_per_cent(changes, within):
    """Forces of the rigid-plastic solution of 3.3 within 1 %, and what folding over side by side adds.

    No new mesh changes the force by more than the 0.5 % that issue 3 allows.
    """
    run = Run(read_scene(BILLET, set=["workpieces.billet.remesh=true", "stop.stroke=10.5", *changes]))
    assert not run.failed() and len(run.jumps) > 3
    assert np.abs(run.jumps).max() < 0.005
    for reduction, force in zip((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (261.6, 307.5, 366, 450, 588, 865), strict=True):
        assert run.at(15 * reduction)[0] == pytest.approx(force, rel=within)
    _, contact, _, equator = run.at(9.0)[1]
    assert equator == pytest.approx(16.54, rel=0.005)
    assert contact == pytest.approx(13.8, abs=0.5)        # of the reference + 0.25, one of its elements
    mean_pressure = run.at(10.5)[0] * 1e3 / (pi * run.at(10.5)[1][3] ** 2)
    assert mean_pressure > 700 + 300 * np.log(1 / 0.3), "friction costs: more than the flow stress of the mean strain"
