"""A run stopped half-way and resumed goes on as if it had not been stopped.

The checkpoint holds all that the next step starts from: positions, strains, velocities, stresses and rates at the
integration points, pressures and friction stresses at the contact points. So no solve is repeated, and what differs is
rounding (5e-15 measured; `same` allows 1e-8). Without the contact points, forces differed by 2e-4 (billet) to 4e-3 (the
block, whose flow is not unique).
"""

from __future__ import annotations

import pytest

from .scenes import BILLET, BLOCK, COARSE_BILLET, CUBE, run
from .test_failures import table
from .test_ranks import on_ranks, same


def resumed(text, folder, half, *changes, ranks: int = 1):
    """The results of a run that was stopped by the change ``half`` and went on without it."""
    run(text, folder, *changes, half)
    if ranks > 1:
        return on_ranks(ranks, text, folder, *changes, resume=True)
    return run(text, folder, *changes, resume=True).results


def goes_on(whole, again) -> None:
    """The same rows, none twice; the frames of the uninterrupted run, and that of the break."""
    one, other = whole.history, again.history
    assert other.column("step").tolist() == one.column("step").tolist(), "no row twice, none missing"
    same(one, other)
    times = [round(t, 9) for t, _ in again.frames]
    assert times == sorted(set(times)) and {round(t, 9) for t, _ in whole.frames} <= set(times)


@pytest.fixture(scope="module")
def whole_billet(tmp_path_factory):
    return run(BILLET, tmp_path_factory.mktemp("whole"), *COARSE_BILLET).results


def test_resumed_billet_goes_on(whole_billet, tmp_path):
    again = resumed(BILLET, tmp_path, "stop.stroke='4.5 mm'", *COARSE_BILLET)
    goes_on(whole_billet, again)
    assert again.summary["stopped"] == "stroke 9 mm reached"
    assert 4.5 in [time for time, _ in again.frames], "the end of the first part"
    whole, resumed_one = (results.summary["ledger"]["power"] for results in (whole_billet, again))
    assert resumed_one["penalty_share"] == pytest.approx(whole["penalty_share"], rel=1e-8), "summed over both parts"
    assert resumed_one["worst_relative_imbalance"] == pytest.approx(whole["worst_relative_imbalance"], rel=1e-6)


@pytest.mark.mpi
def test_resumed_on_two_ranks_it_goes_on_too(whole_billet, tmp_path):
    again = resumed(BILLET, tmp_path, "stop.stroke='4.5 mm'", *COARSE_BILLET, ranks=2)
    goes_on(whole_billet, again)
    assert again.summary["ranks"] == 2


@pytest.mark.parametrize("scheme", ["'explicit'", "'etd2'", "{ scheme = 'trapezoid', rotation = true }", "'rotation'",
                                    "{ scheme = 'substeps', rule = 'midpoint' }"])
def test_every_scheme_can_be_resumed(scheme, tmp_path):
    """In plane strain between two tools, with damage; etd2 and sub-steps take what they know of the flow before along."""
    changes = (f"process.shifting={scheme}", "materials.lead.damage={ law = 'cockcroft_latham', critical = 0.001 }")
    whole = run(BLOCK, tmp_path / "whole", *changes).results
    again = resumed(BLOCK, tmp_path, "stop.stroke='0.25 mm'", *changes)
    goes_on(whole, again)
    assert again.history.rows[-1]["max_damage"] > 0.001
    passed = [results.summary["ledger"]["damage"]["passed_at_step"] for results in (whole, again)]
    assert passed[0] == passed[1]


def test_resumed_cube_goes_on(tmp_path):
    whole = run(CUBE, tmp_path / "whole").results
    goes_on(whole, resumed(CUBE, tmp_path, "stop.stroke='0.2 mm'"))


def test_heavy_body_keeps_the_mass_of_its_points_over_a_break(tmp_path):
    """Its density follows from masses that stay while nodes move. Made anew from the moved nodes they were others: by
    4e-9 in the force of a hot billet, by 5e-8 in this one; `same` allows 1e-8."""
    heavy = ("process.weight=true", "materials.lead.density='1e7 kg/m^3'")
    whole = run(BLOCK, tmp_path / "whole", *heavy).results
    goes_on(whole, resumed(BLOCK, tmp_path, "stop.stroke='0.25 mm'", *heavy))


def test_resumed_in_free_travel(tmp_path):
    """Nothing touches the body yet at the checkpoint: it must not be taken for a flowing one."""
    far = "tools.upper.shape.point=[0, 2.12]"
    whole = run(BLOCK, tmp_path / "whole", far).results
    again = resumed(BLOCK, tmp_path, "stop={ stroke = 0.1 }", far)
    goes_on(whole, again)


def test_resumed_where_the_tool_turns(tmp_path):
    """The checkpoint lies at the time at which the table turns back."""
    drive = table([0, 0.2, 0.4, 0.6], [0, 0.2, 0.1, 0.3])
    whole = run(BLOCK, tmp_path / "whole", drive, "stop={ time = 0.6 }").results
    run(BLOCK, tmp_path, drive, "stop={ time = 0.2 }")
    goes_on(whole, run(BLOCK, tmp_path, drive, "stop={ time = 0.6 }", resume=True).results)


def test_resumed_twice(tmp_path):
    whole = run(BLOCK, tmp_path / "whole").results
    run(BLOCK, tmp_path, "stop.stroke=0.15")
    run(BLOCK, tmp_path, "stop.stroke=0.3", resume=True)
    goes_on(whole, run(BLOCK, tmp_path, resume=True).results)


def test_resume_goes_back_to_the_checkpoint_and_drops_the_rows_after_it(tmp_path):
    """A killed run leaves rows after its last checkpoint: they are computed again, not written twice."""
    whole = run(BLOCK, tmp_path / "whole", "output.checkpoint_every=4").results
    run(BLOCK, tmp_path, "output.checkpoint_every=4", "stop.stroke=0.2")
    kept = (tmp_path / "checkpoint.npz").read_bytes()
    run(BLOCK, tmp_path, "output.checkpoint_every=4", "stop.stroke=0.35", resume=True)
    (tmp_path / "checkpoint.npz").write_bytes(kept)     # as if killed before the next one
    goes_on(whole, run(BLOCK, tmp_path, "output.checkpoint_every=4", resume=True).results)
