"""Bodies that fill the space between tools go on to the end of the stroke: sticking closed dies, walls along a punch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.results.progress import Silent

DEMO = Path(__file__).parents[2] / "demos" / "scenes" / "closed_die.toml"


@pytest.mark.long
def test_closed_die_to_which_the_billet_sticks_closes_to_the_end(tmp_path):
    """Points of the flash land and open by turns: the run ended at 27.3 of 28 mm, the velocities never settled."""
    sticks = [f"tools.{name}.friction={{law='sticking'}}" for name in ("upper", "lower")]
    scene = ff.read_scene(DEMO, set=["workpieces.billet.mesh_size='1.8 mm'", "steps.stroke='0.25 mm'", *sticks])
    results = ff.simulate(scene, tmp_path)
    end = results.history.rows[-1]
    assert end["stroke_upper_mm"] == pytest.approx(28, abs=1e-9)
    assert abs(end["volume_error_billet"]) < 1e-10
    # the dies are in balance; the penalty's share of landing flash points is what is left, as in the demo
    assert end["force_lower_N"] == pytest.approx(end["force_upper_N"], rel=0.01)
    # a thinner flash that sticks holds the metal back the more: Siebel's factor 0.3 takes 1.15 MN
    assert end["force_upper_N"] > 1.5e6


CAN = """
geometry = "axisymmetric"
[materials.al]
from = "aluminium_1100_O"
[workpieces.slug]
shape = { kind = "rectangle", from = [0, 0], to = [20, 10] }
material = "al"
mesh_size = "1.2 mm"
remesh = true
[tools.punch]
shape = { kind = "rectangle", from = [0, 10], to = [17, 60], fillet = 1 }
drive = { kind = "speed", velocity = [0, "-10 mm/s"] }
friction = { law = "siebel", factor = 0.1 }
[tools.container]
shape = { kind = "polyline", points = [[0, 0], [20, 0], [20, 60]], side = "left" }
friction = { law = "siebel", factor = 0.1 }
[steps]
stroke = "0.25 mm"
[stop]
stroke = "6 mm"
"""


class Heard(Silent):
    """Keeps what a run says."""

    def __init__(self):
        self.notes = []

    def note(self, text: str) -> None:
        self.notes.append(text)


@pytest.mark.long
def test_wall_of_a_can_gets_new_meshes_to_the_end(tmp_path):
    """3 mm thick, with a lip where it leaves the punch: a cell there folded over when the volume was given back, and the
    old mesh stayed for the rest of the run."""
    (tmp_path / "can.toml").write_text(CAN)
    heard = Heard()
    results = ff.simulate(ff.read_scene(tmp_path / "can.toml"), tmp_path / "out", observer=heard)
    assert not [note for note in heard.notes if "the mesh stays" in note] and results.summary["remeshings"] > 10
    rows = results.history.rows
    assert rows[-1]["stroke_punch_mm"] == pytest.approx(6, abs=1e-9) and abs(rows[-1]["volume_error_slug"]) < 1e-10
    # steady extrusion: once the wall stands, the force creeps up with friction and hardening, without jumps
    force = np.array([row["force_punch_N"] for row in rows if row["stroke_punch_mm"] > 3])
    assert np.abs(np.diff(force) / force[1:]).max() < 0.03
