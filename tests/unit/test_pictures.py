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


def test_columns_of_the_history_are_drawn_over_the_stroke_or_else_over_time(smooth):
    ax = ff.plot_history(smooth, ["volume_error_billet"])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("stroke of upper (mm)", "volume error billet")
    resting = ff.History()
    for step in range(3):
        resting.append({"step": step, "time_s": 0.5 * step, "a_temperature_degC": 20.0 + step, "b_temperature_degC": 20.0})
    ax = ff.plot_history(ff.Results(None, history=resting), ["a_temperature_degC", "b_temperature_degC"], title="skin")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time (s)", "skin (°C)") and len(ax.get_legend().get_texts()) == 2


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


def test_a_turned_section_has_the_volume_of_the_body(smooth):
    """Flat triangles on an inscribed polygon of 48 sides hold 0.3 % less than pi r² h."""
    from fenics_forming.results.pictures.drawing import frame_of
    from fenics_forming.results.pictures.revolved import turned
    from fenics_forming.results.pictures.skin import Skin

    section = Skin.read(frame_of(smooth, 0)[1]).mirrored(1, 0.0)
    for angle, most in ((360.0, 0.005), (270.0, 0.005)):
        solid, outlines = turned(section, angle)
        a, b, c = solid.points[solid.triangles].transpose(1, 0, 2)
        volume = abs(np.einsum("ki,ki->k", a, np.cross(b, c))).sum() / 6
        exact = np.pi * 100 * 30 * angle / 360
        # tetrahedra with their tips in the middle of the axis; those of the cut faces are flat
        assert volume == pytest.approx(exact, rel=most)
        assert bool(outlines) == (angle < 360)


def test_a_whole_body_is_drawn_from_its_section_and_only_there(smooth, tmp_path):
    pytest.importorskip("pyvista")
    picture = ff.plot_revolved(smooth, path=tmp_path / "turned.png")
    assert picture.shape == (900, 1200, 3) and (tmp_path / "turned.png").exists()
    assert len(np.unique(picture[300:600, 450:750].reshape(-1, 3), axis=0)) > 5
    strip = upset(tmp_path / "strip", geometry="plane_strain")
    with pytest.raises(ResultsError, match="axisymmetric"):
        ff.plot_revolved(strip)


def test_a_film_has_a_picture_of_one_size_for_each_frame(smooth, tmp_path):
    image = pytest.importorskip("PIL.Image")
    film = image.open(ff.animate(smooth, path=tmp_path / "film.gif", fps=5))
    assert film.n_frames == 3 and min(film.size) > 200
    with pytest.raises(ResultsError, match="a film is a .gif or an .mp4"):
        ff.animate(smooth, path=tmp_path / "film.avi")
    with pytest.raises(ResultsError, match="no field 'misspelt'"):
        ff.animate(smooth, "misspelt", path=tmp_path / "film.gif")


def test_a_film_in_mp4_needs_ffmpeg_and_says_so(smooth, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    with pytest.raises(ResultsError, match="ffmpeg, which is not installed; write a .gif"):
        ff.animate(smooth, path=tmp_path / "film.mp4")


def test_tools_in_space_are_turned_about_their_axis_and_moved():
    """A quarter turn about x takes y to z; 2-D turns are those about z."""
    from fenics_forming.results.pictures.outlines import _turn

    assert _turn(np.pi / 2, (1, 0, 0), 3) @ [0, 1, 0] == pytest.approx([0, 0, 1])
    assert _turn(0.3, (0, 0, 1), 3)[:2, :2] == pytest.approx(_turn(0.3, None, 2))
