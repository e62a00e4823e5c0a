"""The outline around the parts of an assembled tool, which workpieces meet where the tool has no shape of its own."""

import tomllib
from pathlib import Path

import pytest

from fenics_forming import scene
from fenics_forming.errors import SceneError
from fenics_forming.scene.joined import joined

DIE = Path(__file__).parents[2] / "demos" / "scenes" / "assembled_die.toml"


def rectangle(low, high, **more):
    return scene.Rectangle(from_=low, to=high, **more)


@pytest.mark.parametrize("parts, points", [
    ([((20, 0), (40, 40)), ((40, 0), (80, 40))], [(20, 0), (80, 0), (80, 40), (20, 40)]),
    ([((0, 0), (10, 10)), ((10, 0), (20, 10)), ((0, 10), (20, 15))], [(0, 0), (20, 0), (20, 15), (0, 15)]),
    ([((0, 0), (10, 10)), ((10, -5), (20, 15))], [(0, 0), (10, 0), (10, -5), (20, -5), (20, 15), (10, 15), (10, 10),
                                                  (0, 10)])])
def test_what_parts_share_is_inside(parts, points):
    found = joined([rectangle(*part) for part in parts])
    assert found.volume_or_area() == pytest.approx(sum(rectangle(*part).volume_or_area() for part in parts))
    turned = [tuple(point) for point in found.corners.tolist()]
    first = turned.index(points[0])
    assert turned[first:] + turned[:first] == points


def test_roundings_of_the_outline_stay():
    found = joined([rectangle((20, 0), (40, 40), fillet=(0, 0, 0, 3)), rectangle((40, 0), (80, 40))])
    assert dict(zip(map(tuple, found.corners.tolist()), found.radii.tolist(), strict=True))[20.0, 40.0] == 3.0
    assert sorted(found.radii) == [0.0, 0.0, 0.0, 3.0]


@pytest.mark.parametrize("other", [((10.1, 0), (20, 10)), ((9, 0), (20, 10)), ((10, 10), (20, 20))],
                         ids=["gap", "overlap", "corner"])
def test_parts_that_do_not_lie_side_by_side_have_none(other):
    assert joined([rectangle((0, 0), (10, 10)), rectangle(*other)]) is None


def test_assembled_die_needs_no_shape_of_its_own(tmp_path):
    """Scene of the demo without the shape of the die; it comes back from its own text."""
    given = tomllib.loads(DIE.read_text())
    name = next(name for name, tool in given["tools"].items() if "parts" in tool)
    del given["tools"][name]["shape"]
    found = scene.Scene.read(given)
    assert found.tools[name].shape == scene.Polygon(points=[(20, 0), (80, 0), (80, 40), (20, 40)])
    scene.check(found)
    scene.write_scene(found, tmp_path / "scene.toml")
    assert scene.read_scene(tmp_path / "scene.toml") == found
    parts = list(given["tools"][name]["parts"].values())
    parts[1]["shape"]["from"] = [41, 0]
    with pytest.raises(SceneError, match="no common outline"):
        scene.check(scene.Scene.read(given))
