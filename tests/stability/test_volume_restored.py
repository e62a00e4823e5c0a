"""Volume restored in every step: on two ranks as on one, resumed as uninterrupted, and said where it cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from .scenes import BILLET, CUBE, run
from .test_ranks import on_ranks, same

RESTORED = ("process.volume_constancy='each_step'", "steps.scheme='explicit'")
COARSE = ("workpieces.billet.mesh_size='2.5 mm'", "steps.stroke='0.5 mm'", "stop.stroke='3 mm'")


def ledger(results):
    return results.summary["ledger"]["volume"]


@pytest.mark.mpi
@pytest.mark.parametrize(("text", "changes"), [(BILLET, COARSE), (CUBE, ())], ids=["billet", "cube"])
def test_two_ranks_give_back_what_one_gives_back(text, changes, tmp_path):
    one = run(text, tmp_path / "one", *changes, *RESTORED).results
    two = on_ranks(2, text, tmp_path / "two", *changes, *RESTORED)
    same(one.history, two.history)
    assert abs(ledger(one)["relative_error"]) < 1e-12 and ledger(one)["worst_relative_error"] < 1e-12
    assert ledger(two)["by"] == pytest.approx(ledger(one)["by"], abs=1e-9)
    assert ledger(one)["by"]["given back"] > 1e-3, "explicit steps lose volume"


def test_ledger_of_a_resumed_run_counts_from_the_start(tmp_path):
    """Also what was lost and given back before the break, and the worst error."""
    loose = ("steps.scheme='explicit'", *COARSE)
    for changes in (loose, (*loose, RESTORED[0])):
        whole = run(BILLET, tmp_path / "whole", *changes).results
        run(BILLET, tmp_path / "part", *changes, "stop.stroke='1.5 mm'")
        again = run(BILLET, tmp_path / "part", *changes, resume=True).results
        assert ledger(again)["by"] == pytest.approx(ledger(whole)["by"], abs=1e-12)
        assert ledger(again)["worst_relative_error"] == pytest.approx(ledger(whole)["worst_relative_error"], abs=1e-12)
        by = ledger(again)["by"]
        assert sum(by.values()) == pytest.approx(ledger(again)["relative_error"], abs=1e-15)
        assert np.abs(again.history.column("volume_error_billet")[-1] - sum(by.values())) < 1e-15


def test_volume_that_cannot_be_given_back_is_said():
    """The ledger doubts a restored volume that is off by more than rounding, and no other below one per cent."""
    from fenics_forming.results.recording.ledger import VolumeLedger

    kept = VolumeLedger(100.0, restored=True)
    kept.book({"corners": -0.5})
    assert kept.error(99.5) == pytest.approx(-5e-3)
    assert "could not be given back" in kept.doubts("smaller steps")[0]
    kept.book({"given back": 0.5})
    kept.error(100.0)
    assert kept.doubts("smaller steps") == []
    assert kept.summary()["by"] == pytest.approx({"integration": 0, "corners": -5e-3, "remeshing": 0, "given back": 5e-3})
