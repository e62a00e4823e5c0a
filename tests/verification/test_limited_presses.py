"""Presses with a force limit whose frame or die yields: the drive stays behind and the frame gives way, under one force."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.errors import SceneError
from fenics_forming.simulation.run import Simulation

from .test_coupling_columns import Heard

# 20 x R10 mm, 100 MPa: at 50 kN the section is 500 mm^2, the height 12.566 mm; the frame has yielded 0.25 mm
COLUMN = """
geometry = "axisymmetric"
[materials.metal]
flow_stress = { law = "constant", value = "100 MPa" }
[workpieces.column]
shape = { kind = "rectangle", from = [0, 0], to = [10, 20] }
material = "metal"
mesh_size = "5 mm"
[tools.upper]
shape = { kind = "plane", point = [0, 20], normal = [0, -1] }
drive = { kind = "hydraulic", speed = 1, direction = [0, -1], force = "50 kN", stiffness = "200 kN/mm" }
[tools.lower]
shape = { kind = "plane", point = [0, 0], normal = [0, 1] }
[process]
volume_constancy = "each_step"
[steps]
time = 0.25
[stop]
time = 10
[solver]
penalty_factor = 1000.0
"""
HEIGHT, YIELD = 100 * np.pi * 100 * 20 / 50e3, 50e3 / 200e3

COIN = """
geometry = "axisymmetric"
[materials.copper]
flow_stress = { law = "swift", K = "450 MPa", prestrain = 0.01, n = 0.3 }
[materials.steel]
young = "210 GPa"
poisson = 0.3
[workpieces.coin]
shape = { kind = "rectangle", from = [0, 0], to = [12, 3] }
symmetry = ["z"]
material = "copper"
mesh_size = "1.2 mm"
[tools.upper]
shape = { kind = "rectangle", from = [0, 3], to = [25, 33] }
material = "steel"
mesh_size = { contact = "1.2 mm", far = "8 mm" }
held = { z_high = ["r", "z"] }
drive = { kind = "hydraulic", speed = 1, direction = [0, -1], force = "200 kN", stiffness = "4000 kN/mm" }
friction = { law = "siebel", factor = 0.2 }
[steps]
time = 0.04
[stop]
time = 1.0
"""


def run(text: str, folder, *changes, resume=None, out=None):
    """A run with these changes, and what it said."""
    (folder / "scene.toml").write_text(text)
    simulation, heard = Simulation(ff.read_scene(folder / "scene.toml", set=changes), resume=resume), Heard()
    simulation.run(out, observer=heard)
    return simulation, heard


@pytest.mark.parametrize("kind", ["hydraulic", "force"])
def test_a_press_on_a_frame_stalls_where_its_force_is_the_strength_of_the_column(kind, tmp_path):
    """The ram has gone the way that the column has given and F/K of the frame. What is left, 0.5 %: the hydraulic press
    comes nearer to its limit for ever, the given force lands within its last step."""
    text = COLUMN if kind == "hydraulic" else COLUMN.replace('"hydraulic"', '"force"').replace("time = 0.25", "time = 0.1")
    simulation, heard = run(text, tmp_path)
    row = heard.rows[-1]
    assert row["force_upper_N"] == pytest.approx(50e3, rel=2e-3)
    assert row["deflection_upper_mm"] == pytest.approx(YIELD, rel=3e-3)
    assert simulation.body.height() == pytest.approx(HEIGHT, rel=5e-3)
    assert row["stroke_upper_mm"] == pytest.approx(20 - simulation.body.height() + row["deflection_upper_mm"], abs=2e-3)


def test_a_frame_changes_nothing_of_where_a_press_stalls(tmp_path):
    """The height at the limit is that without a frame; so it is on a frame a thousand times as stiff, step by step."""
    stiff, _ = run(COLUMN.replace("200 kN/mm", "2e5 kN/mm"), tmp_path)
    rigid, _ = run(COLUMN.replace(', stiffness = "200 kN/mm"', ""), tmp_path)
    heights = [r._recorder.history.column("force_upper_N") for r in (stiff, rigid)]
    assert np.abs(heights[0] - heights[1]).max() < 2e-3 * 50e3
    assert stiff.body.height() == pytest.approx(rigid.body.height(), rel=1e-3)


@pytest.mark.parametrize("mode", ["coupled", "separate"])
def test_a_tool_that_is_solved_after_its_limited_press_is_refused(mode, tmp_path):
    with pytest.raises(SceneError, match=f"process.tool_deformation: '{mode}' solves the tool 'upper' after its press"):
        run(COIN, tmp_path, f"process.tool_deformation={mode}")


@pytest.mark.parametrize("mode", ["stress_only", "iterated"])
def test_a_limited_press_with_an_elastic_die_stays_at_its_limit_and_is_resumed_there(mode, tmp_path):
    """The limit is met and kept to 0.5 %; interrupted before and within it, the run goes on as if it had not been."""
    changes = (f"process.tool_deformation={mode}", "output.checkpoint_every=1")
    whole, heard = run(COIN, tmp_path, *changes)
    force = np.array([row["force_upper_N"] for row in heard.rows])
    assert np.abs(force[-5:] / 200e3 - 1).max() < 5e-3
    assert heard.rows[-1]["deflection_upper_mm"] > 0.05
    for half in (0.4, 0.8):
        out = tmp_path / str(half)
        run(COIN, tmp_path, *changes, f"stop.time={half}", out=out)
        resumed, _ = run(COIN, tmp_path, *changes, resume=out / "checkpoint.npz", out=out)
        expected, found = (r._recorder.history for r in (whole, resumed))
        assert len(expected) == len(found)
        for name in expected.columns:
            if name not in ("wall_s", "power_imbalance"):
                a, b = expected.column(name), found.column(name)
                assert np.abs(a - b).max() <= 1e-10 * max(1.0, np.abs(a).max()), (half, name)


@pytest.mark.long
@pytest.mark.mpi
def test_a_limited_press_with_an_elastic_die_is_resumed_on_two_ranks_to_rounding(tmp_path):
    """Interrupted where the limit holds the press back; 2e-13 measured."""
    (tmp_path / "scene.toml").write_text(COIN)

    def forming(folder: str, *words: str):
        command = ["mpirun", "-n", "2", sys.executable, "-m", "fenics_forming", "run", str(tmp_path / "scene.toml"),
                   "--out", str(tmp_path / folder), "--quiet", "--set=output.checkpoint_every=1", *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=900, env=os.environ)
        assert done.returncode == 0, done.stderr[-2000:]
        return ff.Results.read(tmp_path / folder).history

    whole = forming("whole")
    forming("half", "--set=stop.time=0.8")
    again = forming("half", "--resume")
    for name in ("force_upper_N", "stroke_upper_mm", "deflection_upper_mm", "newton_iterations"):
        np.testing.assert_allclose(again.column(name), whole.column(name), rtol=1e-10, atol=1e-10)
