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


DIE = """
geometry = "axisymmetric"
[materials.al]
flow_stress = { law = "swift", K = "180 MPa", prestrain = 0.01, n = 0.2 }
[workpieces.slug]
shape = { kind = "rectangle", from = [0, 0], to = [10, 26] }
material = "al"
mesh_size = "1.5 mm"
remesh = true
[tools.lower]
shape = { kind = "polyline", side = "left", fillet = [0, 0.6, 0.6, 0.6, 0.8, 0],
          points = [[-1, 0], [13, 0], [13.7, 7], [16.7, 7], [17.7, 5], [30, 5]] }
friction = FRICTION
[tools.upper]
shape = { kind = "polyline", side = "right", fillet = [0, 0.6, 0.6, 0.6, 0.8, 0],
          points = [[-1, 26], [13, 26], [13.7, 19], [16.7, 19], [17.7, 21], [30, 21]] }
friction = FRICTION
drive = { kind = "speed", velocity = [0, "-50 mm/s"] }
[steps]
stroke = "0.5 mm"
[stop]
stroke = "11 mm"
"""


def test_a_die_that_rubs_with_all_of_k_presses_as_one_that_sticks(tmp_path):
    """A factor of 1 lets metal slip only where the shear reaches its yield stress, where what sticks yields as well."""
    ends = []
    for friction in ('{ law = "sticking" }', '{ law = "siebel", factor = 1.0 }'):
        path = tmp_path / "die.toml"
        path.write_text(DIE.replace("FRICTION", friction).replace(",\n          points", ", points"), encoding="utf-8")
        rows = ff.simulate(ff.read_scene(path)).history.rows
        assert rows[-1]["stroke_upper_mm"] == pytest.approx(11, abs=1e-9)
        assert abs(rows[-1]["volume_error_slug"]) < 1e-10
        ends.append([row["force_upper_N"] for row in rows])
    ratio = np.divide(*ends)
    assert abs(ratio[:-1].mean() - 1) < 0.003       # before the cavity is full only what slips below the regularisation,
    assert np.abs(ratio[:-1] - 1).max() < 0.02      # and points that land on the walls in another step
    assert abs(ratio[-1] - 1) < 0.1                 # the flash doubles the force in the last step of 0.5 mm
