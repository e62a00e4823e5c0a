"""Random scenes that broke a law once, kept as they were found: what was wrong is the name of the file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fenics_forming import simulate
from fenics_forming.scene import Scene
from tests.stability import test_random_formings as formings
from tests.stability import test_random_processes as processes

FOUND = sorted((Path(__file__).parent / "found").glob("*.json"))
QUICK = "a_plate_that_gives_way", "a_blow_that_dies_away"


@pytest.mark.parametrize("path", [pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else pytest.mark.long)
                                  for path in FOUND])
def test_scene_that_broke_a_law_keeps_it_now(path):
    values = json.loads(path.read_text(encoding="utf-8"))
    scene = Scene.read(values)
    if "title" not in values and len(scene.workpieces) > 1:
        processes.check_layers(scene, simulate(scene).history)
    else:
        (formings if "title" in values else processes).check_laws(scene, simulate(scene))
