"""What a run leaves behind comes back as it was, whoever wrote it and on however many ranks."""

import json
import subprocess
import sys
import textwrap
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_forming.physics.gather import (
    gather_cell_values,
    gather_cells,
    gather_nodal,
    scatter_cell_values,
    scatter_nodal,
)
from fenics_forming.physics.meshing import box, rectangle
from fenics_forming.physics.nodes import Nodes
from fenics_forming.results import (
    FieldWriter,
    History,
    Progress,
    Results,
    ResultsError,
    Silent,
    load_checkpoint,
    plot_fields,
    plot_force_stroke,
    plot_run,
    read_frames,
    save_checkpoint,
    write_summary,
)
from fenics_forming.results.pictures.outlines import flipped, tool_outlines
from fenics_forming.results.pictures.skin import Skin
from fenics_forming.results.recording.ledger import PowerLedger
from fenics_forming.results.table import laid_out

ALONE = MPI.COMM_SELF


def bulged(nodes):
    """Curve the sides of the body by a quadratic, so that the mid-nodes count."""
    x = nodes.x
    x[:, 0] *= 1 + 0.1 * (1 - x[:, -1] ** 2)
    return nodes


@pytest.fixture(params=[2, 3], ids=["triangles", "tetrahedra"])
def nodes(request):
    if request.param == 2:
        return bulged(Nodes(rectangle((0, -1), (2, 1), (3, 2), ALONE)))
    return bulged(Nodes(box((0, 0, -1), (2, 1, 1), (2, 1, 2), ALONE)))


def row(step, **more):
    return {
        "step": step,
        "time_s": 0.1 * step,
        "stroke_upper_mm": step / 3,
        "force_upper_N": 1e5 * step,
        "newton_iterations": np.int64(4),
        "wall_s": 1.0,
        **more,
    }


def sample_run(folder, nodes, steps=4, scene=None):
    history, writer = History(folder / "history.csv"), FieldWriter(folder, ALONE)
    for step in range(steps):
        history.append(row(step, volume_error_billet=1e-5))
        strain = 0.2 * step + 0.1 * nodes.x[:, 0]
        writer.write(
            nodes,
            step=step,
            time=0.1 * step,
            cell_data={"size_mm": nodes.cell_sizes()},
            point_data={
                "velocity_mm_per_s": nodes.x,
                "effective_strain": strain,
                "mean_stress_MPa": -100 * strain,
                "temperature_degC": 20.0,
            },
        )
    write_summary(folder, {"stopped": "stroke 1 mm reached", "newton_iterations_per_solve": np.float64(4.0)})
    return Results(folder, scene=scene)


def scene_of(nodes, *symmetry):
    geometry = "axisymmetric" if nodes.dim == 2 else "3d"
    return SimpleNamespace(
        title="Made up", geometry=geometry, workpieces={"b": SimpleNamespace(symmetry=symmetry)}
    )


# ------------------------------------------------------------------ history
def test_history_keeps_every_digit_and_counts_stay_whole(tmp_path):
    history = History(tmp_path / "history.csv")
    for step, value in enumerate([1 / 3, 1e-300, -0.1, np.float64(np.pi)]):
        history.append(row(step, odd=value))
    again = History.read(tmp_path / "history.csv")
    assert again.rows == history.rows and again.columns == history.columns
    assert all(type(r["step"]) is int and type(r["newton_iterations"]) is int for r in again.rows)
    assert again.column("step").dtype.kind == "i" and again.column("odd").dtype == float


def test_a_row_is_on_disk_as_soon_as_it_is_appended(tmp_path):
    history = History(tmp_path / "history.csv")
    for step in range(3):
        history.append(row(step))
        assert len(History.read(tmp_path / "history.csv")) == step + 1


def test_a_line_cut_off_by_an_interruption_is_left_out_and_then_overwritten(tmp_path):
    path = tmp_path / "history.csv"
    history = History(path)
    for step in range(3):
        history.append(row(step))
    path.write_text(path.read_text()[:-4])
    again = History.read(path)
    assert [r["step"] for r in again.rows] == [0, 1]
    again.append(row(2, time_s=7.0))
    assert list(History.read(path).column("time_s")) == [0.0, 0.1, 7.0]


def test_a_resumed_history_continues_after_the_step_of_the_checkpoint(tmp_path):
    history = History(tmp_path / "history.csv")
    for step in range(5):
        history.append(row(step))
    again = History.read(tmp_path / "history.csv")
    again.truncate_after(2)
    again.append(row(3, time_s=9.0))
    assert list(History.read(tmp_path / "history.csv").column("step")) == [0, 1, 2, 3]
    assert History.read(tmp_path / "history.csv").rows[-1]["time_s"] == 9.0


def test_a_new_history_replaces_the_old_file(tmp_path):
    for count in (4, 2):
        history = History(tmp_path / "history.csv")
        for step in range(count):
            history.append(row(step))
    assert len(History.read(tmp_path / "history.csv")) == 2


def test_history_says_what_is_wrong(tmp_path):
    history = History()
    history.append(row(0))
    with pytest.raises(ValueError, match="no column \\['misspelt'\\]"):
        history.append(row(1, misspelt=1.0))
    history.append({"step": 1})
    assert np.isnan(history.rows[-1]["force_upper_N"]) and history.rows[-1]["step"] == 1
    with pytest.raises(ResultsError, match="no column 'force_lower_N'.*force_upper_N"):
        history.column("force_lower_N")
    (tmp_path / "bad.csv").write_text("step,time_s\n0,abc\n")
    with pytest.raises(ResultsError, match="line 2 of"):
        History.read(tmp_path / "bad.csv")
    with pytest.raises(ResultsError, match="absent.csv.* could not be read"):
        History.read(tmp_path / "absent.csv")


# ------------------------------------------------------------------ fields
def curved_volume(nodes):
    """Volume by dolfinx itself, with the true geometry."""
    import ufl
    from dolfinx import fem

    return fem.assemble_scalar(fem.form(1.0 * ufl.dx(nodes.mesh, metadata={"quadrature_degree": 6})))


def test_the_volume_seen_by_vtk_is_that_of_the_curved_mesh(tmp_path, nodes):
    """VTK sums a fine straight subdivision; wrongly ordered mid-nodes would be off by the whole bulge."""
    pyvista = pytest.importorskip("pyvista")
    path = FieldWriter(tmp_path, ALONE).write(nodes, step=0, time=0.0, point_data={"x_mm": nodes.x[:, 0]})
    grid = pyvista.read(path)
    fine = (
        grid.tessellate(max_n_subdivide=4)
        if nodes.dim == 3
        else grid.extract_surface(nonlinear_subdivision=5)
    )
    size = fine.volume if nodes.dim == 3 else fine.area
    straight = nodes.cell_sizes().sum()
    exact = curved_volume(nodes)
    assert abs(size / exact - 1) < 3e-3 < abs(straight / exact - 1)
    assert np.array_equal(grid.point_data["x_mm"], grid.points[:, 0])


def test_every_cell_of_a_frame_has_positive_jacobians(tmp_path, nodes):
    meshio = pytest.importorskip("meshio")
    frame = meshio.read(FieldWriter(tmp_path, ALONE).write(nodes, step=0, time=0.0, point_data={}))
    (block,) = frame.cells
    dim = nodes.dim
    corners = frame.points[block.data[:, : dim + 1], :dim]
    assert block.type == {2: "triangle6", 3: "tetra10"}[dim]
    assert (np.linalg.det(corners[:, 1:] - corners[:, :1]) > 0).all()
    ends = {2: [(0, 1), (1, 2), (2, 0)], 3: [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]}[dim]
    middles = frame.points[block.data[:, dim + 1 :], :dim]
    halfway = np.stack([corners[:, list(e)].mean(axis=1) for e in ends], axis=1)
    assert (
        np.abs(middles - halfway).max() < 0.1
    )  # the bulge moves a mid-node by less than 0.1 mm, an edge is 0.67


def test_fields_come_back_with_their_values_and_three_components(tmp_path, nodes):
    meshio = pytest.importorskip("meshio")
    values = {
        "velocity_mm_per_s": 2 * nodes.x,
        "effective_strain": nodes.x[:, 0] ** 2,
        "temperature_degC": 20.0,
    }
    frame = meshio.read(
        FieldWriter(tmp_path, ALONE).write(
            nodes, step=12, time=0.5, point_data=values, cell_data={"size_mm": nodes.cell_sizes()}
        )
    )
    assert (tmp_path / "fields_000012.vtu").exists()
    assert np.array_equal(frame.point_data["velocity_mm_per_s"], 2 * frame.points)
    assert np.array_equal(frame.point_data["effective_strain"], frame.points[:, 0] ** 2)
    assert (frame.point_data["temperature_degC"] == 20.0).all()
    assert frame.cell_data["size_mm"][0].sum() == pytest.approx(nodes.cell_sizes().sum(), rel=1e-14)


def test_frames_are_listed_with_their_times_and_bodies(tmp_path, nodes):
    writer = FieldWriter(tmp_path, ALONE)
    for step in range(2):
        for body in ("core", "sleeve"):
            writer.write(nodes, step=step, time=step / 3, point_data={}, body=body)
    assert [(t, p.name) for t, p in read_frames(tmp_path)] == [
        (k / 3, f"fields_00000{k}_{body}.vtu") for k in range(2) for body in ("core", "sleeve")
    ]
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(tmp_path / "fields.pvd")
    assert reader.time_values == [0.0, 1 / 3] and len(reader.read()) == 2


def test_a_resumed_run_keeps_the_earlier_frames_and_a_new_one_removes_them(tmp_path, nodes):
    writer = FieldWriter(tmp_path, ALONE)
    (tmp_path / "fields_of_corn.vtu").write_text("not ours")
    for step in range(4):
        writer.write(nodes, step=step, time=float(step), point_data={})
    again = FieldWriter(tmp_path, ALONE, resume_after=1)
    again.write(nodes, step=2, time=2.5, point_data={})
    assert [t for t, _ in read_frames(tmp_path)] == [0.0, 1.0, 2.5]
    assert sorted(p.name for p in tmp_path.glob("fields_0*")) == [f"fields_00000{k}.vtu" for k in range(3)]
    FieldWriter(tmp_path, ALONE)
    assert [p.name for p in tmp_path.iterdir()] == ["fields_of_corn.vtu"]


def test_an_interrupted_frame_leaves_the_frames_before_it(tmp_path, nodes, monkeypatch):
    meshio = pytest.importorskip("meshio")
    writer = FieldWriter(tmp_path, ALONE)
    writer.write(nodes, step=0, time=0.0, point_data={})

    def interrupted(path, *_, **__):
        path.write_text("half a file")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(meshio, "write", interrupted)
    with pytest.raises(ResultsError, match="No space left"):
        writer.write(nodes, step=1, time=1.0, point_data={})
    assert [p.name for _, p in read_frames(tmp_path)] == ["fields_000000.vtu"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["fields.pvd", "fields_000000.vtu"]


# ------------------------------------------------------------------ gathering and checkpoints
def test_what_is_gathered_scatters_back(nodes):
    values = np.sin(nodes.x)
    assert np.array_equal(scatter_nodal(nodes, gather_nodal(nodes, values)), values)
    sizes = nodes.cell_sizes()
    assert np.array_equal(scatter_cell_values(nodes, gather_cell_values(nodes, sizes)), sizes)
    assert np.array_equal(
        gather_nodal(nodes, nodes.x)[gather_cells(nodes)], gather_cell_values(nodes, nodes.x[nodes.cells])
    )


def test_a_checkpoint_comes_back_bit_by_bit(tmp_path, nodes):
    state = {"strain": np.sqrt(np.abs(nodes.x[:, 0])), "velocity": np.sin(nodes.x)}
    scalars = {"time": 1 / 3, "step": np.int64(7), "why": "contact", "extents": np.eye(2)}
    save_checkpoint(
        tmp_path / "c.npz", nodes, scalars=scalars, nodal=state, cellwise={"size": nodes.cell_sizes()}
    )
    loaded = load_checkpoint(tmp_path / "c.npz", nodes)
    assert all(np.array_equal(loaded.nodal[name], values) for name, values in state.items())
    assert np.array_equal(loaded.positions, nodes.x)
    assert np.array_equal(loaded.cellwise["size"], nodes.cell_sizes())
    assert loaded.scalars == {"time": 1 / 3, "step": 7, "why": "contact", "extents": [[1, 0], [0, 1]]}
    assert [p.name for p in tmp_path.iterdir()] == ["c.npz"]


def test_the_mesh_of_a_checkpoint_is_the_mesh_as_it_lay(tmp_path, nodes):
    save_checkpoint(tmp_path / "c.npz", nodes, scalars={}, nodal={"x": nodes.x})
    rebuilt = Nodes(load_checkpoint(tmp_path / "c.npz").mesh(ALONE))
    assert np.array_equal(load_checkpoint(tmp_path / "c.npz", rebuilt).nodal["x"], rebuilt.x)
    # the order of summation may differ
    assert curved_volume(rebuilt) == pytest.approx(curved_volume(nodes), rel=1e-13)


def test_a_checkpoint_of_another_mesh_is_refused(tmp_path, nodes):
    save_checkpoint(tmp_path / "c.npz", nodes, scalars={}, nodal={})
    other = Nodes(rectangle((0, 0), (1, 1), (2, 2), ALONE))
    with pytest.raises(ResultsError, match="belongs to another mesh"):
        load_checkpoint(tmp_path / "c.npz", other)


@pytest.mark.parametrize(
    "damage",
    [
        lambda b: b[: len(b) // 2],
        lambda b: b"",
        lambda b: b"PK" + b[9:],
        lambda b: b.replace(np.float64(1.9).tobytes(), np.float64(1.8).tobytes(), 1),
    ],
    ids=["half", "empty", "scrambled", "one number"],
)
def test_a_damaged_checkpoint_says_so(tmp_path, nodes, damage):
    path = tmp_path / "c.npz"
    save_checkpoint(path, nodes, scalars={"time": 1.0}, nodal={"x": np.full(nodes.count, 1.9)})
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(ResultsError, match="is damaged or is not one"):
        load_checkpoint(path, nodes)


def test_a_missing_checkpoint_says_so(tmp_path):
    with pytest.raises(ResultsError, match="there is no checkpoint"):
        load_checkpoint(tmp_path / "c.npz")


def test_an_interrupted_checkpoint_leaves_the_one_before_it(tmp_path, nodes, monkeypatch):
    path = tmp_path / "c.npz"
    save_checkpoint(path, nodes, scalars={"step": 1}, nodal={})

    def interrupted(file, **_):
        file.write(b"half a file")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", interrupted)
    with pytest.raises(ResultsError, match="No space left"):
        save_checkpoint(path, nodes, scalars={"step": 2}, nodal={})
    assert load_checkpoint(path, nodes).scalars == {"step": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["c.npz"]


ON_TWO_RANKS = """
    import sys
    from pathlib import Path
    import numpy as np
    from mpi4py import MPI
    from fenics_forming.physics.meshing import rectangle
    from fenics_forming.physics.nodes import Nodes
    from fenics_forming.results import FieldWriter, History, ResultsError, load_checkpoint, save_checkpoint
    comm, folder = MPI.COMM_WORLD, Path(sys.argv[1])
    assert comm.size == 2
    nodes = Nodes(load_checkpoint(folder / "given.npz").mesh(comm))
    assert np.array_equal(load_checkpoint(folder / "given.npz", nodes).nodal["x"], nodes.x)
    save_checkpoint(folder / "two.npz", nodes, scalars={"step": 3}, cellwise={"x": nodes.x[nodes.cells]},
                    nodal={"x": nodes.x, "f": np.sin(nodes.x)})
    born_apart = Nodes(rectangle((0, 0), (2, 1), (4, 3), comm))
    save_checkpoint(folder / "born_apart.npz", born_apart, scalars={}, nodal={"x": born_apart.x})
    FieldWriter(folder / "two", comm).write(nodes, step=0, time=0.0, point_data={"f": np.sin(nodes.x)},
                                            cell_data={"x": nodes.x[nodes.cells][:, 0]})
    history = History(folder / "history.csv", comm)
    for step in range(3):
        history.append({"step": step, "time_s": 0.1})
    again = History.read(folder / "history.csv", comm)
    again.truncate_after(1)
    assert len(again) == 2
    for path in ("absent.npz", "history.csv"):
        try:
            load_checkpoint(folder / path, nodes)
        except ResultsError as error:
            print("refused", flush=True)
"""


@pytest.mark.mpi
def test_files_do_not_depend_on_the_number_of_ranks(tmp_path, nodes):
    meshio = pytest.importorskip("meshio")
    nodes.x[:] += 1e-3 * np.random.default_rng(1).random(nodes.x.shape)
    save_checkpoint(tmp_path / "given.npz", nodes, scalars={}, nodal={"x": nodes.x})
    FieldWriter(tmp_path / "one", ALONE).write(
        nodes,
        step=0,
        time=0.0,
        point_data={"f": np.sin(nodes.x)},
        cell_data={"x": nodes.x[nodes.cells][:, 0]},
    )
    (tmp_path / "script.py").write_text(textwrap.dedent(ON_TWO_RANKS))
    run = subprocess.run(
        ["mpirun", "-n", "2", sys.executable, tmp_path / "script.py", tmp_path],
        timeout=900,
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("refused") == 4  # two files, and both ranks hear of each

    loaded = load_checkpoint(tmp_path / "two.npz", nodes)
    assert np.array_equal(loaded.nodal["x"], nodes.x) and np.array_equal(loaded.nodal["f"], np.sin(nodes.x))
    assert np.array_equal(loaded.cellwise["x"], nodes.x[nodes.cells]) and loaded.scalars == {"step": 3}
    born_apart = load_checkpoint(tmp_path / "born_apart.npz")
    together = Nodes(born_apart.mesh(ALONE))
    assert np.array_equal(load_checkpoint(tmp_path / "born_apart.npz", together).nodal["x"], together.x)
    assert together.cell_sizes().sum() == pytest.approx(2.0, rel=1e-14)
    assert len(History.read(tmp_path / "history.csv")) == 2
    one, two = (meshio.read(tmp_path / name / "fields_000000.vtu") for name in ("one", "two"))
    assert np.array_equal(one.points, two.points) and np.array_equal(one.cells[0].data, two.cells[0].data)
    assert np.array_equal(one.point_data["f"], two.point_data["f"])
    assert np.array_equal(one.cell_data["x"][0], two.cell_data["x"][0])


# ------------------------------------------------------------------ results
def test_results_are_read_from_a_folder_and_introduce_themselves(tmp_path, nodes):
    sample_run(tmp_path, nodes)
    results = Results.read(tmp_path)
    assert results.tools == ("upper",) and results.force_unit() == "N" and results.scene is None
    assert list(results.force("upper")) == [0.0, 1e5, 2e5, 3e5] and results.stroke()[-1] == 1.0
    assert len(results.frames) == 4 and results.summary["newton_iterations_per_solve"] == 4.0
    told = repr(results)
    for fact in (
        "stroke 1 mm",
        "largest force 300 kN at 1 mm",
        "volume error 1.00e-05",
        "4.0 iterations per solve",
        "4.0 s",
        "stroke 1 mm reached",
        "4 in fields.pvd",
    ):
        assert fact in told


def test_a_roll_that_only_turns_has_no_stroke_but_a_torque():
    history = History()
    for step, force in enumerate([0.0, 7e3, 6e3]):
        history.append({"step": step, "time_s": 0.5 * step, "stroke_roll_mm": 0.0, "force_roll_N_per_mm": force,
                        "torque_roll_Nmm": 20 * force})
    told = repr(Results(None, history=history))
    assert "largest force 7 kN/mm at 0.5 s, largest torque 140 N m/mm" in told and "stroke" not in told


def test_at_interpolates_between_steps_and_knows_its_reach(tmp_path):
    history = History()
    for step, stroke in enumerate([0.0, 1.0, 2.0, 1.0]):
        history.append(row(step, stroke_upper_mm=stroke))
    results = Results(None, history=history)
    assert results.at(stroke=1.5)["force_upper_N"] == pytest.approx(1.5e5, rel=1e-15)
    assert results.at(stroke=1.0) == history.rows[1]
    assert results.at(stroke=2.0)["step"] == 2
    assert results.at(time=0.25)["stroke_upper_mm"] == pytest.approx(1.5)
    with pytest.raises(ResultsError, match="never at 2.5 mm; its history goes from 0 to 2 mm"):
        results.at(stroke=2.5)
    with pytest.raises(ResultsError, match="stroke or a time"):
        results.at()
    with pytest.raises(ResultsError, match="no tool 'lower'; its tools are upper"):
        results.at(stroke=1.0, tool="lower")


def test_names_of_tools_are_read_from_the_columns_in_every_geometry():
    history = History()
    history.append(
        {"step": 0, "stroke_upper_die_mm": 0.0, "force_upper_die_N_per_mm": 3.0, "force_N_N_per_mm": 1.0}
    )
    results = Results(None, history=history)
    assert results.tools == ("upper_die", "N") and results.main_tool() == "upper_die"
    assert results.force_unit() == "N/mm" and list(results.force("N")) == [1.0]


def test_a_folder_without_results_says_so(tmp_path):
    with pytest.raises(ResultsError, match="holds no results"):
        Results.read(tmp_path)
    assert "none yet" in repr(Results(None))


def test_an_unfinished_run_can_be_read(tmp_path, nodes):
    sample_run(tmp_path, nodes)
    (tmp_path / "summary.json").unlink()
    assert Results.read(tmp_path).summary == {} and "4.0 iterations per solve" in repr(Results.read(tmp_path))
    (tmp_path / "summary.json").write_text("{")
    with pytest.raises(ResultsError, match="is not JSON"):
        _ = Results.read(tmp_path).summary


def test_the_summary_holds_plain_numbers(tmp_path):
    write_summary(tmp_path, {"a": np.float64(1.5), "b": np.arange(2), "c": {"d": np.int32(1)}})
    assert json.loads((tmp_path / "summary.json").read_text()) == {"a": 1.5, "b": [0, 1], "c": {"d": 1}}


# ------------------------------------------------------------------ progress
def test_progress_prints_one_row_per_step_under_its_heads(capsys):
    with Progress(total=1.0) as progress:
        progress.started("one billet")
        for step in range(3):
            progress.step(row(step), "stroke")
        progress.note("step cut: no convergence")
        progress.finished(Results(None))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "one billet" and lines[-3] == "  step cut: no convergence"
    assert lines[1].split()[:2] == ["step", "time"] and lines[2].split() == ["s", "mm", "N"]
    assert lines[5].split() == ["2", "0.2", "0.66667", "200000", "4", "stroke"]
    assert len({len(line) - len(line.split()[-1]) for line in lines[3:6]}) == 1
    assert all(lines[1].index("limited") == line.index("stroke") for line in lines[3:6])


@pytest.mark.parametrize("tools", [1, 2, 5])
@pytest.mark.parametrize("unit", ["N", "N_per_mm"])
def test_a_table_fits_the_terminal(tools, unit):
    """Heads one below the other, then fewer columns; step, time, a stroke, a force, strain and Newton always stay."""
    names = [f"tool_{k}" for k in range(tools)]
    columns = ("step", "time_s", *(f"stroke_{n}_mm" for n in names), *(f"force_{n}_{unit}" for n in names),
               "torque_tool_0_Nmm", "max_effective_strain", "min_temperature_degC", "max_temperature_degC",
               "newton_iterations")
    all_of_them, _, wide = laid_out(columns, float("inf"))
    assert all_of_them == columns and len(wide) == 2 and wide[0].endswith("limited by")
    kept, widths, lines = laid_out(columns, 80)
    assert max(map(len, lines)) <= 80 and len(kept) == len(widths)
    assert {"step", "time_s", "stroke_tool_0_mm", f"force_tool_0_{unit}", "max_effective_strain",
            "newton_iterations"} <= set(kept)
    assert list(kept) == [c for c in columns if c in kept]


@pytest.mark.parametrize(
    "observer",
    [Silent(), Progress(total=1.0, quiet=True), Progress(SimpleNamespace(rank=1), total=1.0)],
    ids=["silent", "quiet", "other rank"],
)
def test_nobody_speaks_who_should_not(observer, capsys):
    with observer:
        observer.started("one billet")
        observer.step(row(0), "stroke")
        observer.note("cut")
        observer.finished(Results(None))
    assert capsys.readouterr() == ("", "")


# ------------------------------------------------------------------ pictures
def test_a_mirrored_skin_closes_and_doubles_the_area(tmp_path, nodes):
    sample_run(tmp_path, nodes, steps=1)
    skin = Skin.read([read_frames(tmp_path)[0][1]])
    whole = skin.mirrored(0, 0.0)

    def area(s):
        a, b, c = (s.points[s.triangles[:, k]] for k in range(3))
        normals = np.cross(
            np.pad(b - a, ((0, 0), (0, 3 - nodes.dim))), np.pad(c - a, ((0, 0), (0, 3 - nodes.dim)))
        )
        return np.linalg.norm(normals, axis=1).sum() / 2

    face = 0.0 if nodes.dim == 2 else 1 * 2  # the mirror plane of a body in space is inside the whole
    assert area(whole) == pytest.approx(2 * (area(skin) - face), rel=1e-12)
    _, rim = whole.sides()
    on_mirror = np.abs(whole.points[rim, 0]).max(axis=1) < 1e-9
    assert not on_mirror.any() and (nodes.dim == 2) == bool(len(rim))


def test_a_run_makes_its_pictures(tmp_path):
    pytest.importorskip("matplotlib")
    nodes = Nodes(rectangle((0, 0), (2, 1), (3, 2), ALONE))
    results = sample_run(tmp_path, nodes, scene=scene_of(nodes, "z"))
    made = plot_run(results, tmp_path / "plots", tools=[[(0, 1), (3, 1)]])
    assert [p.name for p in made] == [
        "force_stroke.png",
        "effective_strain.png",
        "mean_stress.png",
        "temperature.png",
        "mesh.png",
    ]
    assert all(p.stat().st_size > 5000 for p in made)


def test_a_section_is_shown_whole_with_units_on_its_axes(tmp_path):
    pytest.importorskip("matplotlib")
    nodes = Nodes(rectangle((0, 0), (2, 1), (3, 2), ALONE))
    results = sample_run(tmp_path, nodes, scene=scene_of(nodes, "z"))
    ax = plot_fields(results, "velocity")
    low, high = ax.get_xlim()
    assert low < -2 and high > 2 and ax.get_ylim()[0] < -1
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("r (mm)", "z (mm)")
    assert [a.get_ylabel() or a.get_xlabel() for a in ax.figure.axes[1:]] == ["velocity (mm/s)"]
    assert plot_fields(results, mirror=False).get_xlim()[0] > -0.2
    with pytest.raises(ResultsError, match="no field 'misspelt'; it has effective_strain, mean_stress_MPa"):
        plot_fields(results, "misspelt")
    with pytest.raises(ResultsError, match="there is no frame 9: the run wrote 4 frames"):
        plot_fields(results, frame=9)


def test_tools_are_drawn_where_they_are_at_that_time(tmp_path):
    """A plane that has come down by 2 mm, up to the mirror planes; a roll at rest keeps its radius."""
    path = tmp_path / "scene.toml"
    path.write_text(TWO_TOOLS)
    history = History(tmp_path / "history.csv")
    for step in range(4):
        history.append({"step": step, "time_s": step, "stroke_upper_mm": step, "force_upper_N": 1.0})
    body = np.array([[0.0, -13.0], [10.0, 13.0]])
    plane, roll = tool_outlines(Results(tmp_path), 2.0, body, [(0, 0.0), (1, 0.0)])
    assert np.ptp(plane[..., 1]) < 1e-12 and plane[0, 0, 1] == pytest.approx(13.0)
    assert plane[..., 0].min() == pytest.approx(0.0) and plane[..., 0].max() > 10.0
    # where the picture ends, the line ends on a chord, which is less than 0.02 mm from its arc
    assert np.allclose(np.linalg.norm(roll - [14.0, 5.0], axis=-1), 3.0, atol=0.02)
    assert np.array_equal(flipped(plane, 1, 0.0)[..., 1], -plane[..., 1])


TWO_TOOLS = """
    geometry = "axisymmetric"
    [materials.m]
    flow_stress = { law = "constant", value = "100 MPa" }
    [workpieces.billet]
    shape = { kind = "rectangle", from = [0, 0], to = [10, 15] }
    material = "m"
    symmetry = ["z"]
    [tools.upper]
    shape = { kind = "plane", point = [0, 15], normal = [0, -1] }
    drive = { kind = "speed", velocity = [0, "-1 mm/s"] }
    [tools.roll]
    shape = { kind = "circle", centre = [14, 5], radius = 3 }
    [steps]
    stroke = "1 mm"
    [stop]
    stroke = "3 mm"
"""


def test_several_runs_share_one_diagram():
    pytest.importorskip("matplotlib")
    runs = []
    for scale in (1.0, 2.0):
        history = History()
        for step in range(3):
            history.append(row(step, force_upper_N=scale * 1e6 * step))
        runs.append(Results(None, history=history))
    ax = plot_force_stroke(runs, labels=["one", "two"])
    assert ax.get_ylabel() == "force of upper (MN)" and ax.get_xlabel() == "stroke of upper (mm)"
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["one", "two"]
    assert ax.get_lines()[1].get_ydata()[-1] == 4.0


def test_a_body_in_space_is_drawn_off_screen(tmp_path):
    pytest.importorskip("pyvista")
    nodes = Nodes(box((0, 0, 0), (2, 1, 1), (2, 1, 1), ALONE))
    results = sample_run(tmp_path, nodes, scene=scene_of(nodes, "z"))
    picture = plot_fields(results, path=tmp_path / "p.png")
    assert picture.shape == (900, 1200, 3) and (tmp_path / "p.png").exists()
    middle = picture[300:600, 450:750].reshape(-1, 3)
    assert len(np.unique(middle, axis=0)) > 20  # the body is there, in several colours


def test_a_body_that_lands_without_rebound_is_told_from_a_tool_whose_power_the_penalty_takes():
    """Where nothing but its own motion moves the body, what the penalty takes is the impact, not an error of a force."""
    ledger = PowerLedger()
    ledger.last, ledger.work, ledger.penalty_work = {"inertia": 0.0, "penalty": 0.0}, 1.0, 0.9
    assert "lands without rebound" in ledger.doubts("smaller steps")[0]
    ledger.tool_work = 1.0
    assert "90.0 % of the tool power" in ledger.doubts("smaller steps")[0]
