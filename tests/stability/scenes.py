"""Small scenes as text, and what every run must leave behind however it ends."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.results import Results
from fenics_forming.results.progress import Silent

DEMOS = Path(__file__).resolve().parents[2] / "demos" / "scenes"

BILLET = (DEMOS / "billet_upsetting.toml").read_text(encoding="utf-8")
COARSE_BILLET = ("workpieces.billet.mesh_size='2 mm'", "steps.stroke='0.5 mm'")

RING = (DEMOS / "ring_compression.toml").read_text(encoding="utf-8")
COARSE_RING = ("workpieces.ring.mesh_size='1.25 mm'", "steps.stroke='0.1 mm'", "stop.stroke='1 mm'")

EXTRUSION = (DEMOS / "extrusion.toml").read_text(encoding="utf-8")

BLOCK = """
title = "A block between two plates in plane strain"
geometry = "plane_strain"

[materials.lead]
flow_stress = { law = "constant", value = "100 MPa" }

[workpieces.block]
shape = { kind = "rectangle", from = [0, 0], to = [4, 2] }
material = "lead"
mesh_size = "0.5 mm"

[tools.upper]
shape = { kind = "plane", point = [0, 2], normal = [0, -1] }
drive = { kind = "speed", velocity = [0, "-1 mm/s"] }
friction = { law = "siebel", factor = 0.5 }

[tools.lower]
shape = { kind = "plane", point = [0, 0], normal = [0, 1] }
friction = { law = "siebel", factor = 0.5 }

[steps]
stroke = "0.05 mm"

[stop]
stroke = "0.5 mm"
"""

PUNCHES = """
title = "Two narrow punches indent a strip in plane strain"
geometry = "plane_strain"

[materials.lead]
flow_stress = { law = "constant", value = "100 MPa" }

[workpieces.strip]
shape = { kind = "rectangle", from = [-6, -2], to = [6, 2] }
material = "lead"
mesh_size = "1 mm"

[tools.upper]
shape = { kind = "rectangle", from = [-1.5, 2], to = [1.5, 8], fillet = "0.3 mm" }
drive = { kind = "speed", velocity = [0, "-1 mm/s"] }
friction = { law = "siebel", factor = 0.3 }

[tools.lower]
shape = { kind = "rectangle", from = [-1.5, -8], to = [1.5, -2], fillet = "0.3 mm" }
friction = { law = "siebel", factor = 0.3 }

[steps]
stroke = "0.05 mm"

[stop]
stroke = "0.3 mm"
"""

CUBE = """
title = "An eighth of a cube between rough plates"
geometry = "3d"

[materials.metal]
flow_stress = { law = "linear", initial = "100 MPa", hardening = "50 MPa" }

[workpieces.cube]
shape = { kind = "box", from = [0, 0, 0], to = [2, 2, 2] }
material = "metal"
symmetry = ["x", "y", "z"]
mesh_size = "1.4 mm"

[tools.upper]
shape = { kind = "plane", point = [0, 0, 2], normal = [0, 0, -1] }
drive = { kind = "speed", velocity = [0, 0, "-1 mm/s"] }
friction = { law = "siebel", factor = 0.3 }

[steps]
stroke = "0.1 mm"

[stop]
stroke = "0.3 mm"
"""


def swept(usual, more):
    """Parameters of a sweep; those in ``more`` run with the long tests."""
    return [*usual, *(pytest.param(*(v if isinstance(v, tuple) else (v,)), marks=pytest.mark.long) for v in more)]


class Listener(Silent):
    """An observer that keeps the notes and the reasons of the steps; interrupts the run after a step if told to."""

    def __init__(self, interrupt_after: int | None = None):
        self.notes: list[str] = []
        self.limited_by: list[str] = []
        self._interrupt_after = interrupt_after

    def note(self, text):
        self.notes.append(text)

    def step(self, row, limited_by):
        self.limited_by.append(limited_by)
        if row["step"] == self._interrupt_after:
            raise KeyboardInterrupt


@dataclass
class Outcome:
    """How a run ended: its results, the error that ended it or None, what its observer heard."""

    results: Results
    failure: ff.ConvergenceError | None
    heard: Listener = field(repr=False)

    @property
    def warnings(self) -> list[str]:
        return self.results.summary["warnings"]

    @property
    def last(self) -> dict[str, float]:
        return self.results.history.rows[-1]

    def work(self) -> float:
        """Force over stroke, N mm: smoother than the force, which jumps when points land."""
        return float(np.trapezoid(self.results.force(), self.results.stroke()))


def scene_file(text: str, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "scene_in.toml"
    path.write_text(text, encoding="utf-8")
    return path


def read(text: str, folder: Path, *changes: str):
    """The scene of a text with changes."""
    return ff.read_scene(scene_file(text, folder), set=changes)


def run(text: str, folder: Path, *changes: str, resume: bool = False) -> Outcome:
    """Run a scene into ``folder``; whatever its end, what is on disk must be whole."""
    from fenics_forming.simulation import simulation_of
    heard, failure = Listener(), None
    scene = read(text, folder, *changes)
    try:
        simulation_of(scene, resume=folder / "checkpoint.npz" if resume else None).run(folder, observer=heard)
    except ff.ConvergenceError as error:
        failure = error
    outcome = Outcome(Results.read(folder), failure, heard)
    whole(outcome)
    return outcome


def whole(outcome: Outcome) -> None:
    """Nothing in the history is not a number; a failure says why and what to try, and its last good frame is there."""
    import meshio
    results, failure = outcome.results, outcome.failure
    for row in results.history.rows:
        assert np.isfinite(list(row.values())).all(), row
    assert results.frames, "not even the body at the start was written"
    assert np.isfinite(meshio.read(results.frames[-1][1]).points).all()
    if failure is None:
        assert "reached" in results.summary["stopped"]
        return
    assert failure.advice and str(failure).count(failure.advice) == 1, "advice, once"
    assert results.summary["stopped"] == f"failed: {failure}"
    if len(results.history):
        assert (results.folder / "checkpoint.npz").exists()
        assert results.frames[-1][0] == pytest.approx(outcome.last["time_s"])
        cuts = [note for note in outcome.heard.notes if note.startswith(f"step {outcome.last['step'] + 1} cut")]
        assert cuts, "it failed without having tried a shorter step"


def balanced(results, lost: float, pushed=slice(None)) -> None:
    """Finite numbers; no body has lost more than ``lost`` of its volume; power balances in the ``pushed`` rows."""
    history = results.history
    for name in history.columns:
        assert np.isfinite(history.column(name)).all(), name
        if name.startswith("volume_error_"):
            worst = np.abs(history.column(name)).max()
            assert worst < lost, f"{name}: {worst:.2%}"
    assert np.abs(history.column("power_imbalance"))[pushed].max(initial=0.0) < 1e-2
