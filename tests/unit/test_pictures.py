"""Pictures beyond force and fields: contact pressure along the surface, whole turns, animations, tools in space."""

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.results.files import ResultsError

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


def upset(folder, friction=None, geometry="axisymmetric", **output):
    """A coarse billet between a platen and a mirror plane, two steps of 1 mm, with frames."""
    rough = {} if friction is None else {"friction": friction}
    scene = ff.Scene(
        title="Upsetting", geometry=geometry, materials={"m": {"flow_stress": ff.laws.Constant(value=100)}},
        workpieces={"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 15]}, "material": "m",
                               "symmetry": ["z"] if geometry == "axisymmetric" else ["x", "y"], "mesh_size": 3}},
        tools={"upper": {"shape": {"kind": "plane", "point": [0, 15], "normal": [0, -1]},
                         "drive": {"kind": "speed", "velocity": [0, -1]}, **rough}},
        steps={"stroke": 1}, stop={"stroke": 2}, output={"fields_every": 1, "checkpoint_every": 0, **output})
    return ff.simulate(scene, folder)


@pytest.fixture(scope="module")
def smooth(tmp_path_factory):
    return upset(tmp_path_factory.mktemp("smooth"))


def test_the_pressure_below_a_smooth_platen_is_the_flow_stress(smooth):
    """Homogeneous upsetting of a rigid-plastic cylinder: p = 100 MPa over the end."""
    (curve,) = ff.contact_pressure(smooth)
    radius = 10 * np.sqrt(15 / 13)
    assert curve.points[0] == pytest.approx([0, 13], abs=0.05) and curve.points[-1, 1] == pytest.approx(0, abs=1e-9)
    assert curve.arc[-1] == pytest.approx(radius + 13, rel=5e-3)
    r, z = curve.points.T
    # nodal values are means over the sides that meet in a node: the last element at the edge has the free side in it
    assert curve.values[(z > 13 - 1e-6) & (r < radius - 3)] == pytest.approx(100, rel=1e-4)
    assert np.allclose(curve.values[curve.points[:, 1] < 10], 0), "the side is free"


def test_the_pressure_is_drawn_for_one_frame_or_several(smooth, tmp_path):
    ax = ff.plot_contact_pressure(smooth, path=tmp_path / "p.png")
    assert (tmp_path / "p.png").stat().st_size > 5000
    assert ax.get_ylabel() == "contact pressure (MPa)" and "from (0, 13)" in ax.get_xlabel()
    several = ff.plot_contact_pressure(smooth, frame=[1, 2])
    assert [t.get_text() for t in several.get_legend().get_texts()] == ["t = 1 s, stroke 1 mm", "t = 2 s, stroke 2 mm"]


def test_the_surface_of_a_quarter_of_a_strip_goes_from_plane_to_plane(tmp_path):
    """In plane strain the curve begins at the first mirror plane (x) and ends at the other one (y)."""
    (curve,) = ff.contact_pressure(upset(tmp_path, geometry="plane_strain"))
    assert curve.points[0, 0] == pytest.approx(0, abs=1e-9) and curve.points[-1, 1] == pytest.approx(0, abs=1e-9)
    assert np.all(np.diff(curve.arc) > 0)


def test_a_closed_outline_begins_at_its_lowest_point_and_comes_back(smooth):
    from types import SimpleNamespace

    alone = ff.Results(smooth.folder, scene=SimpleNamespace(geometry="plane_strain", workpieces={
        "b": SimpleNamespace(symmetry=())}, title="", tools={}))
    (curve,) = ff.contact_pressure(alone)
    assert np.allclose(curve.points[0], curve.points[-1]) and curve.points[0, 1] == curve.points[:, 1].min()
    with pytest.raises(ResultsError, match="no field 'misspelt'"):
        ff.contact_pressure(smooth, field="misspelt")
