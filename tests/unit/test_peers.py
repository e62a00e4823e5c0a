"""The decks that CalculiX gets in the benchmarks, and what is read from its output; CalculiX itself is not needed."""

import sys
from pathlib import Path

import pytest

PEERS = Path(__file__).parents[2] / "benchmarks" / "peers"


@pytest.fixture
def peers(monkeypatch):
    """Modules of the comparison by name; they stand beside one another, outside any package."""
    monkeypatch.syspath_prepend(str(PEERS))
    import block
    import calculix
    import shrink_fit
    import upsetting
    yield {"block": block, "calculix": calculix, "shrink_fit": shrink_fit, "upsetting": upsetting}
    for name in ("block", "calculix", "shrink_fit", "upsetting", "run_all"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize(("kind", "cells", "nodes"), [("CAX8R", (2, 3), 29), ("C3D20R", (2, 2, 2), 81)])
def test_regular_elements_share_their_nodes_and_have_a_positive_size(peers, kind, cells, nodes):
    """Quadratic elements of the serendipity kind: (2a+1)(2b+1) - ab nodes in the plane."""
    deck = peers["calculix"].Deck()
    numbers = deck.grid("BODY", kind, (0,) * len(cells), cells, cells)
    assert len(deck.nodes) == len(set(map(tuple, deck.nodes))) == len(numbers) == nodes
    words = [int(word) for word in ",".join(deck.cards[1:3 if len(cells) == 3 else 2]).split(",") if word]
    corners = [deck.nodes[n - 1] for n in words[1:4]]
    edges = [[b - a for a, b in zip(corners[0], corner, strict=True)] for corner in corners[1:]]
    assert edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0] > 0        # corners run anticlockwise


def test_a_deck_of_a_ring_touches_with_both_sides_and_that_of_a_billet_with_one(peers):
    faces = {}
    for bore in (0.0, 5.0):
        cards = peers["upsetting"].Upsetting(bore, 10.0, 5.0, 0.3, ((700, 0),), (4, 3)).deck().cards
        first, last = cards.index("*SURFACE,NAME=OUTSIDE"), cards.index("*SURFACE,NAME=UNDERSIDE")
        faces[bore] = sorted(cards[first + 1:last])
    assert faces[0.0] == ["12,S2", "4,S2", "8,S2"]
    assert faces[5.0] == sorted(["12,S2", "4,S2", "8,S2", "1,S4", "5,S4", "9,S4"])


def test_forces_and_displacements_are_read_as_they_are_printed(peers):
    text = """
 total force (fx,fy,fz) for set TOP and time  0.5000000E+00

       -1.0E+00  2.0E+00  0.0E+00

 displacements (vx,vy,vz) for set BORE and time  0.5000000E+00

         7  1.5000E-01 -2.5000E-01  0.0000E+00
"""
    run = peers["calculix"].Run(True, 1.0, 1.0, text)
    assert run.total_forces("TOP") == {0.5: [-1.0, 2.0, 0.0]} and run.total_forces("DIE") == {}
    assert run.printed("displacements", "BORE") == {0.5: [[7.0, 0.15, -0.25, 0.0]]}


def test_the_exact_pressure_of_the_shrink_fit_is_that_of_the_references(peers):
    assert peers["shrink_fit"].ShrinkFit(4).pressure == pytest.approx(69.2308, rel=1e-6)


def test_where_calculix_is_missing_one_sentence_says_so(peers, capsys, monkeypatch):
    import run_all

    monkeypatch.setattr(peers["calculix"].shutil, "which", lambda name: None)
    run_all.main([])
    said = capsys.readouterr().out
    assert said.count("\n") == 1 and "not installed" in said
