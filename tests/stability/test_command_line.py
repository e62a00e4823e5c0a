"""``forming run | check | plot | info`` as a user starts them."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from fenics_forming import cli
from fenics_forming.results import Results

from .scenes import BILLET, BLOCK, COARSE_BILLET, run, scene_file

HEAVY = ("dolfinx", "petsc4py", "gmsh", "numba", "mpi4py", "pyvista", "ufl", "basix")


def forming(*words, timeout: float = 900):
    """Exit code, stdout and stderr of the command."""
    done = subprocess.run([sys.executable, "-m", "fenics_forming", *map(str, words)], capture_output=True, text=True,
                          timeout=timeout)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def here(capsys):
    """The same without a new process, for what does not depend on it."""
    def command(*words):
        capsys.readouterr()
        code = cli.main([str(word) for word in words])
        return code, *capsys.readouterr()

    return command


def imported(*words) -> set[str]:
    """The heavy packages that a command imports."""
    script = ("import sys\nfrom fenics_forming.cli import main\ncode = main(sys.argv[1:])\n"
              "print('IMPORTED', code, *(m for m in sys.modules if '.' not in m))")
    done = subprocess.run([sys.executable, "-c", script, *map(str, words)], capture_output=True, text=True, timeout=900)
    line = next(text for text in done.stdout.splitlines() if text.startswith("IMPORTED"))
    return set(line.split()[2:]) & set(HEAVY)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The results of a short run."""
    folder = tmp_path_factory.mktemp("block")
    run(BLOCK, folder, "stop.stroke=0.1")
    return folder


# ---------------------------------------------------------------------- run
def test_run_prints_a_row_per_step_and_writes_the_folder(tmp_path):
    path = scene_file(BLOCK, tmp_path)
    code, out, err = forming("run", path, "--out", tmp_path / "out", "--set", "stop.stroke='0.1 mm'")
    assert (code, err) == (0, "")
    assert "A block between two plates in plane strain" in out and "stroke 0.1 mm reached" in out
    assert {"history.csv", "summary.json", "scene.toml", "fields.pvd", "checkpoint.npz"} <= \
        {p.name for p in (tmp_path / "out").iterdir()}
    assert len((tmp_path / "out" / "history.csv").read_text().splitlines()) == 1 + 3


def test_quiet_prints_nothing_and_set_changes_the_scene_that_is_kept(tmp_path):
    path = scene_file(BLOCK, tmp_path)
    assert forming("run", path, "--out", tmp_path / "out", "--quiet", "--set", "stop.stroke='0.05 mm'", "--set",
                   "tools.upper.friction={ law = 'coulomb', coefficient = 0.1 }") == (0, "", "")
    kept = (tmp_path / "out" / "scene.toml").read_text()
    assert "coulomb" in kept and "stroke = 0.05" in kept
    assert (tmp_path / "out" / "summary.json").exists()


def test_warnings_of_the_results_are_printed(tmp_path, here):
    path = scene_file(BILLET, tmp_path)
    words = [word for change in (*COARSE_BILLET, "steps.stroke=2") for word in ("--set", change)]
    code, out, _ = here("run", path, "--out", tmp_path / "out", *words)
    assert code == 0, "a doubt is no failure"
    assert "warning: penalty and landing points take" in out


@pytest.mark.parametrize(("words", "says"), [
    (["--set", "steps.strok=1"], "did you mean 'stroke'"),
    (["--set", "workpieces.block.material='led'"], "did you mean 'lead'"),
    (["--set", "stop.stroke='5 N'"], "stop.stroke"),
    (["--set", "steps.stroke=9"], "steps.stroke"),
    (["--resume"], "there is no checkpoint"),
], ids=["key", "name", "unit", "size", "resume"])
def test_bad_scene_is_one_sentence_and_writes_nothing(words, says, tmp_path, here):
    path = scene_file(BLOCK, tmp_path)
    code, out, err = here("run", path, "--out", tmp_path / "out", *words)
    assert code == 2 and out == ""
    assert err.startswith("error: ") and says in err and len(err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_missing_scene_file_is_one_sentence(tmp_path):
    code, out, err = forming("run", tmp_path / "none.toml")
    assert code == 2 and out == "" and "does not exist" in err and len(err.splitlines()) == 1


def test_damaged_checkpoint_is_one_sentence(tmp_path, here):
    path = scene_file(BLOCK, tmp_path)
    (tmp_path / "checkpoint.npz").write_bytes(b"not a checkpoint")
    code, out, err = here("run", path, "--out", tmp_path, "--resume", "--quiet")
    assert code == 2 and "damaged" in err and len(err.splitlines()) == 1


# ---------------------------------------------------------------------- check and info
def test_disk_that_fills_up_is_one_sentence_and_the_rest_is_written(tmp_path, here, monkeypatch):
    """The second checkpoint finds no room. numpy's error names no file; summary and frames have room and are written."""
    save, saved = np.savez, []

    def full(file, **arrays):
        saved.append(file)
        if len(saved) > 1:
            raise OSError(28, "No space left on device")
        return save(file, **arrays)

    monkeypatch.setattr(np, "savez", full)
    path, told = scene_file(BLOCK, tmp_path), ["--set", "output.checkpoint_every=2", "--set", "stop.stroke='0.4 mm'"]
    code, _, err = here("run", path, "--out", tmp_path / "out", "--quiet", *told)
    assert code == 1 and len(err.splitlines()) == 1 and err.startswith("the run failed: ")
    assert "checkpoint.npz' could not be read or written: No space left on device" in err and "--resume" in err
    left = Results.read(tmp_path / "out")
    assert left.history.column("step").tolist() == [0, 1, 2, 3, 4] and "No space left" in left.summary["stopped"]
    assert not list((tmp_path / "out").glob(".*")), "no half-written file"
    monkeypatch.undo()
    assert here("run", path, "--out", tmp_path / "out", "--quiet", "--resume", *told)[0] == 0
    assert Results.read(tmp_path / "out").history.column("step").tolist() == list(range(9))


def test_pictures_without_room_are_one_sentence_and_leave_nothing(folder, here, monkeypatch):
    def full(source, target):
        raise OSError(28, "No space left on device", str(source))

    there = sorted(folder.iterdir())
    monkeypatch.setattr(os, "replace", full)
    for command in (("plot", folder), ("report", folder), ("animate", folder)):
        code, out, err = here(*command)
        assert code == 1 and out == "" and "No space left on device" in err and len(err.splitlines()) == 1, command
        assert ".partial" not in err and str(folder) in err
    assert sorted(folder.iterdir()) == there


def test_check_prints_the_scene_and_runs_nothing(tmp_path):
    path = scene_file(BLOCK, tmp_path)
    code, out, err = forming("check", path)
    assert (code, err) == (0, "") and "the scene is fine" in out and "friction" in out
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_check_names_what_is_wrong(tmp_path, here):
    code, out, err = here("check", scene_file(BLOCK, tmp_path), "--set", "geometry='plain_strain'")
    assert code == 2 and "plane_strain" in err and len(err.splitlines()) == 1


def test_check_and_info_import_no_solver(folder, tmp_path):
    path = scene_file(BLOCK, tmp_path)
    assert imported("check", path) == set()
    assert imported("check", path, "--set", "steps.strok=1") == set()
    assert imported("info") == set()
    assert imported("info", folder) == set()
    assert imported("run", path, "--set", "steps.strok=1") == set()


def test_info_tells_versions_and_what_a_folder_holds(folder, tmp_path):
    code, out, _ = forming("info")
    assert code == 0 and "fenics_forming" in out and "petsc4py" in out
    code, out, _ = forming("info", folder)
    assert code == 0 and "largest force" in out and "stroke 0.1 mm reached" in out
    code, out, err = forming("info", tmp_path)
    assert code == 2 and "holds no results" in err and len(err.splitlines()) == 1


# ---------------------------------------------------------------------- plot
def test_plot_writes_pictures_and_names_them(folder):
    code, out, err = forming("plot", folder)
    assert code == 0, err
    pictures = out.split()
    assert {"force_stroke.png", "effective_strain.png", "mesh.png"} <= {name.rsplit("/", 1)[-1] for name in pictures}
    for name in pictures:
        with open(name, "rb") as file:
            assert file.read(8) == b"\x89PNG\r\n\x1a\n"


def test_plot_of_one_field(folder, here):
    code, out, _ = here("plot", folder, "--field", "contact_pressure", "--frame", "0")
    assert code == 0 and out.strip().endswith("contact_pressure.png")


def test_plot_of_a_field_that_is_not_there(folder, here):
    code, out, err = here("plot", folder, "--field", "effective_strian")
    assert code == 2 and "effective_strain" in err and len(err.splitlines()) == 1


def test_plot_of_an_empty_folder(tmp_path, here):
    code, _, err = here("plot", tmp_path)
    assert code == 2 and "holds no results" in err


def test_a_reader_that_has_seen_enough_ends_the_command_without_words():
    done = subprocess.run(f"{sys.executable} -m fenics_forming materials copper_ofhc_warm | head -1", shell=True,
                          capture_output=True, text=True, timeout=900)
    assert done.stdout.startswith("copper_ofhc_warm") and done.stderr == ""
