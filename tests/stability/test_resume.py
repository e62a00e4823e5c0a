"""A run stopped half-way and resumed goes on as if it had not been stopped.

It starts from the same positions, strains, velocities, stresses and rates; only the contact tractions are found anew
from their nodal means, so that the solves differ within the tolerance of the Newton (2e-3 of the force). Measured: 2e-4
of the force, 2e-5 of the radius, 4e-5 of the volume.
"""

from __future__ import annotations

import numpy as np
import pytest

from .scenes import BILLET, BLOCK, COARSE_BILLET, CUBE, run
from .test_failures import table
from .test_ranks import on_ranks

FORCE, SHAPE = 2e-3, 1e-4


def resumed(text, folder, half, *changes, ranks: int = 1):
    """The results of a run that was stopped by the change ``half`` and went on without it."""
    run(text, folder, *changes, half)
    if ranks > 1:
        return on_ranks(ranks, text, folder, *changes, resume=True)
    return run(text, folder, *changes, resume=True).results


def goes_on(whole, again, half_way: float) -> None:
    """The rows up to ``half_way`` seconds are those of before; after it within the tolerance of the Newton."""
    one, other = whole.history, again.history
    assert other.column("step").tolist() == one.column("step").tolist(), "no row twice, none missing"
    time = one.column("time_s")
    assert other.column("time_s") == pytest.approx(time, rel=1e-12)
    for name in one.columns:
        a, b = one.column(name), other.column(name)
        if name in ("wall_s", "newton_iterations", "power_imbalance", "dt_s"):
            continue
        before = time < half_way - 1e-9
        assert b[before] == pytest.approx(a[before], rel=1e-9, abs=1e-9), name
        if name.startswith("force_"):
            assert b == pytest.approx(a, rel=FORCE), name
        elif name.endswith(("_mm", "_mm3")):
            assert b == pytest.approx(a, rel=SHAPE, abs=1e-9), name
    assert [round(t, 9) for t, _ in again.frames] >= [round(t, 9) for t, _ in whole.frames]
    assert len({path for _, path in again.frames}) == len(again.frames)


@pytest.fixture(scope="module")
def whole_billet(tmp_path_factory):
    return run(BILLET, tmp_path_factory.mktemp("whole"), *COARSE_BILLET).results


def test_resumed_billet_goes_on(whole_billet, tmp_path):
    again = resumed(BILLET, tmp_path, "stop.stroke='4.5 mm'", *COARSE_BILLET)
    goes_on(whole_billet, again, 4.5)
    assert again.summary["stopped"] == "stroke 9 mm reached"


@pytest.mark.mpi
def test_resumed_on_two_ranks_it_goes_on_too(whole_billet, tmp_path):
    again = resumed(BILLET, tmp_path, "stop.stroke='4.5 mm'", *COARSE_BILLET, ranks=2)
    goes_on(whole_billet, again, 4.5)
    assert again.summary["ranks"] == 2


def test_frames_of_a_resumed_run_follow_those_of_before(whole_billet, tmp_path):
    again = resumed(BILLET, tmp_path, "stop.stroke='4.5 mm'", *COARSE_BILLET)
    times = [time for time, _ in again.frames]
    assert times == sorted(set(times))
    assert set(np.round([time for time, _ in whole_billet.frames], 9)) <= set(np.round(times, 9))
    assert 4.5 in times, "the end of the first part"


@pytest.mark.parametrize("scheme", ["explicit", "trapezoid", pytest.param("etd2", marks=pytest.mark.long)])
def test_every_scheme_can_be_resumed(scheme, tmp_path):
    """In plane strain with two tools; etd2 has forgotten the flow before and is of first order for a step."""
    changes = (f"steps.scheme='{scheme}'",)
    whole = run(BLOCK, tmp_path / "whole", *changes).results
    goes_on(whole, resumed(BLOCK, tmp_path, "stop.stroke='0.25 mm'", *changes), 0.25)


def test_resumed_cube_goes_on(tmp_path):
    whole = run(CUBE, tmp_path / "whole").results
    goes_on(whole, resumed(CUBE, tmp_path, "stop.stroke='0.2 mm'"), 0.2)


def test_resumed_in_free_travel(tmp_path):
    """Nothing touches the body yet at the checkpoint: it must not be taken for a flowing one."""
    far = "tools.upper.shape.point=[0, 2.12]"
    whole = run(BLOCK, tmp_path / "whole", far).results
    again = resumed(BLOCK, tmp_path, "stop={ stroke = 0.1 }", far)
    goes_on(whole, again, 0.1)


def test_resumed_where_the_tool_turns(tmp_path):
    """The checkpoint lies at the time at which the table turns back."""
    drive = table([0, 0.2, 0.4, 0.6], [0, 0.2, 0.1, 0.3])
    whole = run(BLOCK, tmp_path / "whole", drive, "stop={ time = 0.6 }").results
    run(BLOCK, tmp_path, drive, "stop={ time = 0.2 }")
    goes_on(whole, run(BLOCK, tmp_path, drive, "stop={ time = 0.6 }", resume=True).results, 0.2)


def test_resumed_twice(tmp_path):
    whole = run(BLOCK, tmp_path / "whole").results
    run(BLOCK, tmp_path, "stop.stroke=0.15")
    run(BLOCK, tmp_path, "stop.stroke=0.3", resume=True)
    goes_on(whole, run(BLOCK, tmp_path, resume=True).results, 0.15)


def test_resume_goes_back_to_the_checkpoint_and_drops_the_rows_after_it(tmp_path):
    """A killed run leaves rows after its last checkpoint: they are computed again, not written twice."""
    whole = run(BLOCK, tmp_path / "whole", "output.checkpoint_every=4").results
    run(BLOCK, tmp_path, "output.checkpoint_every=4", "stop.stroke=0.2")
    kept = (tmp_path / "checkpoint.npz").read_bytes()
    run(BLOCK, tmp_path, "output.checkpoint_every=4", "stop.stroke=0.35", resume=True)
    (tmp_path / "checkpoint.npz").write_bytes(kept)     # as if killed before the next one
    goes_on(whole, run(BLOCK, tmp_path, "output.checkpoint_every=4", resume=True).results, 0.2)
