"""Flow lines are lines of the material: they deform as it does, are written with every frame, and are drawn."""

import subprocess
import sys
import textwrap

import meshio
import numpy as np
import pytest

from fenics_forming import laws, scene
from fenics_forming.results import Results
from fenics_forming.results.files import ResultsError
from fenics_forming.results.pictures.plotting import plot_fields, plot_run
from fenics_forming.simulation import Simulation, simulate

LINES = {"slanted": scene.FlowLine(body="billet", from_=(0, 1), to=(10, 6), points=11),
         "upright": scene.FlowLine(body="billet", from_=(4, 0), to=(4, 10), points=3)}


def upsetting(lines=LINES, *, stroke=2.0, shape=None, **more):
    """A billet without friction: the flow is v_z = -V z / h, v_r = V r / (2 h)."""
    return scene.Scene(
        geometry="axisymmetric", materials={"m": scene.Material(flow_stress=laws.Constant(value=100))},
        workpieces={"billet": scene.Workpiece(shape=shape or scene.Rectangle(from_=(0, 0), to=(10, 10)), material="m",
                                              symmetry=["z"], mesh_size=4)},
        tools={"upper": scene.Tool(shape=scene.Plane(point=(0, 10), normal=(0, -1)),
                                   drive=laws.SpeedDrive(velocity=(0, -1)))},
        flow_lines=lines, steps=scene.Steps(stroke=0.25), stop=scene.Stop(stroke=stroke),
        output=scene.Output(fields_every=4, checkpoint_every=4), **more)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return simulate(upsetting(), tmp_path_factory.mktemp("run"))


def written(folder):
    return sorted(path.name for path in folder.glob("flow_lines*"))


# ---------------------------------------------------------------------- physics
def test_lines_deform_as_the_homogeneous_flow_takes_them(run):
    """r grows by (H/h)^(1/2), z shrinks by h/H, the strain is ln(H/h): exact but for the step, 2.5 %² / 24 each."""
    for name, line in LINES.items():
        found = run.flow_line(name)
        start = np.linspace(line.from_, line.to, line.points)
        for step, time, places, strain in zip(found.steps, found.times, found.places, found.fields["effective_strain"],
                                              strict=True):
            ratio = (10 - time) / 10
            assert time == pytest.approx(0.25 * step)
            assert places == pytest.approx(start * [ratio**-0.5, ratio], abs=1e-3)
            assert strain == pytest.approx(-np.log(ratio), abs=1e-3)


def test_every_frame_has_the_lines(run):
    found = run.flow_line("slanted")
    assert found.steps.tolist() == [0, 4, 8] and found.places.shape == (3, 11, 2)
    assert [time for time, _ in run.frames] == found.times.tolist()
    assert written(run.folder) == ["flow_lines.pvd", *(f"flow_lines_00000{k}.vtu" for k in (0, 4, 8))]
    again = Results.read(run.folder).flow_line("slanted")
    assert (again.places == found.places).all(), "the same from the folder alone"
    frame = meshio.read(run.folder / "flow_lines_000008.vtu")
    assert len(frame.points) == 14 and len(frame.cells_dict["line"]) == 10 + 2, "two lines, not joined"


def test_line_that_leaves_the_body_is_pointed_out():
    """An L: both ends lie in it, what is between does not and starts at the surface."""
    bent = scene.Polygon(points=[(0, 0), (10, 0), (10, 4), (4, 4), (4, 10), (0, 10)])
    run = Simulation(upsetting({"cut": scene.FlowLine(body="billet", from_=(3, 9), to=(9, 3), points=5)}, shape=bent))
    warning, = (w for w in run.warnings if w.startswith("flow_lines.cut"))
    assert "2 mm outside the body" in warning, "at (6, 6)"
    assert not [w for w in Simulation(upsetting()).warnings if "outside" in w]


# ---------------------------------------------------------------------- absent, again, resumed
def test_scene_without_lines_follows_none_and_writes_none(tmp_path):
    """Also where an earlier run has left some."""
    simulate(upsetting(stroke=0.25), tmp_path)
    assert written(tmp_path)
    run = Simulation(upsetting({}, stroke=0.25))
    results = run.run(tmp_path)
    assert run.lines is None and not written(tmp_path)
    with pytest.raises(ResultsError, match="no flow line 'slanted'; its flow lines are none"):
        results.flow_line("slanted")


def test_wrong_name_and_run_in_memory_are_told():
    results = simulate(upsetting(stroke=0.25))
    with pytest.raises(ResultsError, match="slantd.*slanted, upright"):
        results.flow_line("slantd")
    with pytest.raises(ResultsError, match="a folder"):
        results.flow_line("slanted")


def test_resumed_run_goes_on_with_the_same_points(run, tmp_path):
    """From the places in the checkpoint: found again in their cells, to round-off."""
    simulate(upsetting(stroke=1.0), tmp_path)
    Simulation(upsetting(), resume=tmp_path / "checkpoint.npz").run(tmp_path)
    found, whole = Results.read(tmp_path).flow_line("slanted"), run.flow_line("slanted")
    assert found.steps.tolist() == whole.steps.tolist() == [0, 4, 8]
    assert found.places == pytest.approx(whole.places, abs=1e-8)


# ---------------------------------------------------------------------- pictures
def test_lines_are_drawn_on_the_mesh_and_mirrored_with_it(run, tmp_path):
    """Four images: of the axis and of the mirror plane; on a field there are none."""
    drawn = [c.get_segments() for c in plot_fields(run, None).collections if hasattr(c, "get_segments")]
    lines = next(segments for segments in drawn if segments and len(segments[0]) == 11)
    last = run.flow_line("slanted").places[-1]
    assert len(lines) == 8
    for sign in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        assert any(len(line) == 11 and np.allclose(line, last * sign) for line in lines)
    drawn = [c.get_segments() for c in plot_fields(run, "effective_strain").collections if hasattr(c, "get_segments")]
    assert not any(segments and len(segments[0]) == 11 for segments in drawn)
    assert tmp_path / "mesh.png" in plot_run(run, tmp_path)


# ---------------------------------------------------------------------- ranks
TWO_RANKS = """
    import sys
    sys.path.insert(0, sys.argv[1])
    from test_flow_lines import upsetting
    from fenics_forming import scene
    from fenics_forming.simulation import simulate
    points = {"rim": scene.TrackedPoint(body="billet", at=(10, 0)), "core": scene.TrackedPoint(body="billet", at=(3, 4))}
    simulate(upsetting(points=points), sys.argv[2])
"""


@pytest.mark.mpi
def test_lines_and_points_are_the_same_on_two_ranks(run, tmp_path):
    (tmp_path / "script.py").write_text(textwrap.dedent(TWO_RANKS))
    here = __file__.rpartition("/")[0]
    done = subprocess.run(["mpirun", "-n", "2", sys.executable, tmp_path / "script.py", here, tmp_path],
                          capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    two = Results.read(tmp_path)
    assert two.summary["ranks"] == 2
    for name in LINES:
        one, other = run.flow_line(name), two.flow_line(name)
        assert one.steps.tolist() == other.steps.tolist()
        assert other.places == pytest.approx(one.places, abs=1e-8)
        assert other.fields["effective_strain"] == pytest.approx(one.fields["effective_strain"], abs=1e-8)
    last = two.history.rows[-1]
    ratio = 0.8
    assert [last["rim_r_mm"], last["rim_z_mm"]] == pytest.approx([10 * ratio**-0.5, 0], abs=1e-3)
    assert [last["core_r_mm"], last["core_z_mm"]] == pytest.approx([3 * ratio**-0.5, 4 * ratio], abs=1e-3)
