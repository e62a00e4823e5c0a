"""Faults from outside: a killed process, a full disk, failing meshers, senseless laws. Nothing written is lost.

"Killed" is SIGKILL: no clean-up runs. What is on disk then is what a power cut would leave.
"""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from typing import Literal

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.laws.flow_stress import FlowStress
from fenics_forming.process.meshes import keeper as mesh_keeper
from fenics_forming.process.meshes import renewing as remeshing
from fenics_forming.process.meshes.keeper import MeshKeeper
from fenics_forming.results import Results, ResultsError
from fenics_forming.simulation import simulation_of

from .scenes import BLOCK, read, run, scene_file

EVERY_STEP = ("output.checkpoint_every=1", "output.fields_every=2")
EXACT = 1e-10       # a run that goes on repeats what it would have done

KILLED = """
    import os, signal, sys
    import numpy as np
    import fenics_forming as ff
    from fenics_forming.results.progress import Silent
    from fenics_forming.simulation import simulation_of

    text, out, moment, step = sys.argv[1:]

    def die(*args, **more):
        os.kill(os.getpid(), signal.SIGKILL)

    class Watch(Silent):
        def step(self, row, limited_by):
            if row["step"] == int(step):
                if moment == "between":
                    die()
                if moment == "checkpoint":              # the file is open and half of it is written
                    save = np.savez
                    np.savez = lambda file, **arrays: (save(file, **dict(list(arrays.items())[:3])), die())
                if moment == "frame":
                    from fenics_forming.results.recording import recorder
                    recorder.Recorder._frame = die
                if moment == "row":                     # half a line stands in the history
                    from fenics_forming.results.history import History
                    with open(os.path.join(out, "history.csv"), "a") as file:
                        file.write("7,0.3")
                    die()

    simulation_of(ff.read_scene(text)).run(out, observer=Watch())
"""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return run(BLOCK, tmp_path_factory.mktemp("undisturbed"), *EVERY_STEP).results


@pytest.mark.parametrize(("moment", "step"), [("between", 3), ("checkpoint", 4),
                                              pytest.param("between", 0, marks=pytest.mark.long),
                                              pytest.param("between", 7, marks=pytest.mark.long),
                                              pytest.param("frame", 5, marks=pytest.mark.long),
                                              pytest.param("row", 6, marks=pytest.mark.long)])
def test_killed_run_goes_on_as_if_nothing_had_happened(moment, step, undisturbed, tmp_path):
    text = scene_file(read(BLOCK, tmp_path, *EVERY_STEP).to_toml(), tmp_path / "in")
    told = [str(text), str(tmp_path / "out"), moment, str(step)]
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(KILLED), *told],
                          capture_output=True, text=True, timeout=900)
    assert done.returncode == -9, done.stderr
    left = Results.read(tmp_path / "out")
    assert len(left.history) >= step and np.isfinite(left.history.column("force_upper_N_per_mm")).all()
    if not (tmp_path / "out" / "checkpoint.npz").exists():
        assert step == 0, "nothing was computed yet that a checkpoint could hold"
        return
    simulation_of(ff.read_scene(text), resume=tmp_path / "out" / "checkpoint.npz").run(tmp_path / "out")
    again = Results.read(tmp_path / "out")
    for column in ("step", "time_s", "force_upper_N_per_mm", "max_effective_strain", "volume_block_mm3"):
        assert again.history.column(column) == pytest.approx(undisturbed.history.column(column), rel=EXACT, abs=EXACT)
    assert [time for time, _ in again.frames] == pytest.approx([time for time, _ in undisturbed.frames])


def test_full_disk_in_the_middle_keeps_what_was_written(tmp_path, monkeypatch):
    """The message names the file; with room again the run goes on from its last checkpoint."""
    real, frames = os.replace, []

    def full(source, target):
        if str(target).endswith(".vtu"):
            frames.append(target)
            if len(frames) > 2:
                raise OSError(28, "No space left on device", str(target))
        return real(source, target)

    monkeypatch.setattr(os, "replace", full)
    scene = read(BLOCK, tmp_path, *EVERY_STEP)
    with pytest.raises(ResultsError, match=r"fields_.*No space left on device"):
        ff.simulate(scene, tmp_path)
    left = Results.read(tmp_path)
    assert len(left.history) >= 4 and len(left.frames) == 2 and (tmp_path / "checkpoint.npz").exists()
    monkeypatch.undo()
    again = simulation_of(scene, resume=tmp_path / "checkpoint.npz").run(tmp_path)
    assert again.history.rows[-1]["stroke_upper_mm"] == pytest.approx(0.5)


class Strange(FlowStress):
    """sigma = 100 MPa up to a strain, and then what ``answer`` says."""

    law: Literal["strange"] = "strange"
    answer: Literal["nan", "negative", "infinite"]
    depends_on_strain = True

    def __call__(self, strain, rate, temperature=None):
        after = {"nan": np.nan, "negative": -100.0, "infinite": np.inf}[self.answer]
        return np.where(np.asarray(strain) > 0.1, after, 100.0) + 0.0 * np.asarray(rate)


@pytest.mark.parametrize("answer", ["nan", "negative", "infinite"])
def test_law_that_answers_nonsense_ends_the_run_in_words(answer, tmp_path):
    """No silent wrong number: rows up to there are on disk, finite, and the last good state with them."""
    scene = read(BLOCK, tmp_path, "stop.stroke=1", "output.checkpoint_every=1")
    materials = {"lead": scene.materials["lead"].model_copy(update={"flow_stress": Strange(answer=answer)})}
    with pytest.raises(ff.ConvergenceError, match="flow stress is not a positive, finite number") as failed:
        ff.simulate(scene.model_copy(update={"materials": materials}), tmp_path)
    assert failed.value.advice
    left = Results.read(tmp_path)
    assert len(left.history) > 2 and (tmp_path / "checkpoint.npz").exists()
    for column in left.history.columns:
        assert np.isfinite(left.history.column(column)).all(), column


def test_meshers_that_fail_do_not_end_a_run_whose_mesh_is_still_good(tmp_path, monkeypatch):
    """Both engines refuse each time: the old mesh goes on, and the run says so."""
    def refuse(*args, **more):
        raise ff.MeshError("no mesh today")

    monkeypatch.setattr(remeshing, "remesh", refuse)
    outcome = run(BLOCK, tmp_path, "workpieces.block.remesh={ every = 2 }")
    assert outcome.failure is None and outcome.last["stroke_upper_mm"] == pytest.approx(0.5)
    assert any("no mesh today" in text for text in outcome.heard.notes)


def test_a_new_mesh_on_which_nothing_flows_is_given_back(tmp_path, monkeypatch):
    """The solve on the new mesh fails once: the run keeps the old mesh, loses no row, and reaches its end."""
    renew, tried = MeshKeeper.renew, []

    def fails_once(self, *args, **more):
        tried.append(1)
        if len(tried) == 1:
            raise ff.ConvergenceError("the new mesh does not flow", advice="try another")
        return renew(self, *args, **more)

    monkeypatch.setattr(MeshKeeper, "renew", fails_once)
    outcome = run(BLOCK, tmp_path, "workpieces.block.remesh={ every = 2 }")
    assert outcome.failure is None and outcome.last["stroke_upper_mm"] == pytest.approx(0.5)
    assert len(tried) > 1


def test_a_warm_body_keeps_its_mesh_where_nothing_flows_on_the_new_one(tmp_path, monkeypatch):
    """A random process found it: temperatures had taken the place of the pressures that were to be restored."""
    carry_on = mesh_keeper._flow
    tried = []

    def fails_once(*args):
        tried.append(1)
        if len(tried) == 1:
            raise ff.ConvergenceError("the new mesh does not flow", advice="try another")
        return carry_on(*args)

    monkeypatch.setattr(mesh_keeper, "_flow", fails_once)
    warm = ("materials.lead.density='11300 kg/m^3'", "materials.lead.conductivity='35 W/m/K'",
            "materials.lead.specific_heat='130 J/kg/K'", "workpieces.block.temperature=20", "process.heat=true")
    outcome = run(BLOCK, tmp_path, "workpieces.block.remesh={ every = 3 }", *warm)
    assert outcome.failure is None and outcome.last["stroke_upper_mm"] == pytest.approx(0.5) and len(tried) > 1
    assert any("the new mesh does not flow" in text for text in outcome.heard.notes)
