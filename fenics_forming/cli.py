"""``forming run | check | plot | animate | report | stresses | materials | info``: the command line."""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from .errors import ConvergenceError, FormingError, MeshError, SceneError, as_lines

BAD_SCENE, FAILED = 2, 1


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; the exit code: 0 done, 1 the run failed, 2 the scene or the command is wrong."""
    options = _parser().parse_args(arguments)
    try:
        return _action(options)
    except SceneError as error:
        return _say_on_one_rank(f"error: {error}", BAD_SCENE)
    except ConvergenceError as error:
        return _say_on_one_rank(f"the run failed: {error}", FAILED)
    except FormingError as error:
        return _say_on_one_rank(f"error: {error}", BAD_SCENE)
    except BrokenPipeError:  # the reader of a pipe, such as `head`, has seen enough: the code that shells give then
        sys.stdout = None
        return 141
    except OSError as error:
        from .results.files import in_words
        return _say_on_one_rank(f"error: {in_words(error)}", FAILED)
    except KeyboardInterrupt:
        return _say_on_one_rank("interrupted; what was computed is on disk, go on with --resume", 130)


def _action(options) -> int:
    """The chosen command; an error nobody foresaw ends all ranks instead of leaving the others waiting."""
    try:
        return options.action(options)
    except (FormingError, KeyboardInterrupt):
        raise
    except Exception:
        mpi = sys.modules.get("mpi4py.MPI")
        if mpi is None or mpi.COMM_WORLD.size == 1:
            raise
        import traceback
        traceback.print_exc()
        mpi.COMM_WORLD.Abort(FAILED)
        raise


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="forming", description="Metal forming on FEniCSx.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="run a scene file")
    run.add_argument("scene", type=Path)
    run.add_argument("--out", type=Path, help="folder for the results (default: results/NAME of the scene file)")
    run.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes",
                     help="change a key of the scene, such as steps.stroke='0.1 mm'")
    run.add_argument("--resume", action="store_true", help="go on from the checkpoint in the folder of the results")
    run.add_argument("--quiet", action="store_true", help="print nothing but errors")
    run.set_defaults(action=_run)

    check = commands.add_parser("check", help="check a scene file without running it")
    check.add_argument("scene", type=Path, nargs="?")
    check.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes")
    check.add_argument("--schema", action="store_true", help="print the JSON schema of scene files instead")
    check.set_defaults(action=_check)

    plot = commands.add_parser("plot", help="draw the results of a run, or the forces of several in one diagram")
    plot.add_argument("folder", type=Path, nargs="+")
    plot.add_argument("--field", help="one field only, such as effective_strain")
    plot.add_argument("--frame", type=int, default=-1, help="number of the frame (default: the last)")
    plot.add_argument("--revolve", action="store_true", help="an axisymmetric body in space, with a quarter cut out")
    plot.add_argument("--tool", help="the tool whose force is drawn (default: the one that travels farthest); with --field "
                      "a tool that deforms, to draw it instead of the workpiece")
    plot.add_argument("--out", type=Path, help="file of the diagram of several runs (default: forces.png in the first)")
    plot.set_defaults(action=_plot)

    animate = commands.add_parser("animate", help="a film of a run: field.gif in its folder, or the file given to --out")
    animate.add_argument("folder", type=Path)
    animate.add_argument("--field", default="effective_strain", help="the field that is shown (default: effective_strain)")
    animate.add_argument("--out", type=Path, help="a .gif, or an .mp4 where ffmpeg is installed")
    animate.add_argument("--fps", type=float, default=8.0, help="frames in a second (default: 8)")
    animate.set_defaults(action=_animate)

    report = commands.add_parser("report", help="one page on a run, report.html in its folder, to read or to send")
    report.add_argument("folder", type=Path)
    report.add_argument("--out", type=Path, help="the file (default: report.html in the folder)")
    report.set_defaults(action=_report)

    materials = commands.add_parser("materials", help="the materials of the library, or one of them with its sources")
    materials.add_argument("name", nargs="?")
    materials.set_defaults(action=_materials)

    stresses = commands.add_parser("stresses", help="stresses of a tool under the contact forces of a run")
    stresses.add_argument("folder", type=Path)
    stresses.add_argument("tool", help="name of a tool with a material that has elastic constants, or with parts")
    stresses.add_argument("--frame", type=int, default=-1, help="number of the frame (default: the last)")
    stresses.add_argument("--path", action="store_true", help="go through all frames up to that one")
    stresses.add_argument("--scene", type=Path, help="take the tool from another scene, as with a finer mesh")
    stresses.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes")
    stresses.add_argument("--out", type=Path, help="folder for the results (default: FOLDER/TOOL)")
    stresses.add_argument("--quiet", action="store_true", help="print nothing but errors")
    stresses.set_defaults(action=_stresses)

    info = commands.add_parser("info", help="versions, laws and shapes; or what a folder of results holds")
    info.add_argument("folder", type=Path, nargs="?")
    info.set_defaults(action=_info)
    return parser


def _run(options) -> int:
    from .scene import check, read_scene
    scene = read_scene(options.scene, set=options.changes)
    check(scene)                     # before dolfinx is imported and anything is written
    out = options.out or Path("results") / options.scene.stem
    checkpoint = out / "checkpoint.npz" if options.resume else None
    if checkpoint is not None and not checkpoint.exists():
        raise SceneError(f"--resume: there is no checkpoint in '{out}'; run without --resume, or name the folder by --out")
    from mpi4py import MPI

    from .results.files import ResultsError
    from .results.progress import Progress
    from .simulation import simulation_of
    total = (scene.stop.stroke or scene.stop.time) if scene.stop is not None else None
    with Progress(MPI.COMM_WORLD, total or float("nan"), quiet=options.quiet) as progress:
        try:
            simulation_of(scene, resume=checkpoint).run(out, observer=progress)
        except (MeshError, ResultsError) as error:
            if not progress.rows:
                raise                    # nothing was computed: a shape without a mesh, a folder that cannot be written
            further = ", go on with --resume" if (out / "checkpoint.npz").exists() else ""
            return _say_on_one_rank(f"the run failed: {error}; what was computed is in '{out}'{further}", FAILED)
    return 0


def _check(options) -> int:
    from .scene import Scene, check, read_scene
    from .scene.printing import broken
    if options.schema:
        import json
        print(json.dumps(Scene.json_schema(), indent=2))
        return 0
    if options.scene is None:
        raise SceneError("name a scene file to check, or --schema")
    scene = read_scene(options.scene, set=options.changes)
    warnings = check(scene)
    print(broken(repr(scene), shutil.get_terminal_size().columns) if sys.stdout.isatty() else scene)
    for warning in warnings:
        print(as_lines(f"warning: {warning}", sys.stdout))
    print(f"{options.scene}: the scene is fine")
    return 0


def _plot(options) -> int:
    from .results.pictures.plotting import plot_fields, plot_force_stroke, plot_run
    from .results.results import Results
    runs = [Results.read(folder) for folder in options.folder]
    folder = options.folder[0]
    if len(runs) > 1:
        path = options.out or folder / "forces.png"
        plot_force_stroke(runs, tool=options.tool, path=path)
        print(path)
    elif options.revolve:
        from .results.pictures.revolved import plot_revolved
        field = options.field or "effective_strain"
        path = folder / f"{field}_revolved.png"
        plot_revolved(runs[0], field, options.frame, path=path)
        print(path)
    elif options.field:
        path = folder / f"{options.field}{'_' * bool(options.tool)}{options.tool or ''}.png"
        plot_fields(runs[0], options.field, options.frame, tool=options.tool, path=path)
        print(path)
    else:
        for path in plot_run(runs[0], folder):
            print(path)
    return 0


def _animate(options) -> int:
    from .results.pictures.animation import animate
    from .results.results import Results
    out = options.out or options.folder / f"{options.field}.gif"
    print(animate(Results.read(options.folder), options.field, path=out, fps=options.fps))
    return 0


def _report(options) -> int:
    from .results.report import write_report
    from .results.results import Results
    print(write_report(Results.read(options.folder), options.out))
    return 0


def _materials(options) -> int:
    from .laws.library import library
    print(library(options.name))
    return 0


def _stresses(options) -> int:
    from .scene import read_scene
    scene = read_scene(options.scene or options.folder / "scene.toml", set=options.changes)
    from mpi4py import MPI

    from .results.progress import Progress
    from .simulation.tool_stresses import tool_stresses
    with Progress(MPI.COMM_WORLD, quiet=options.quiet) as progress:
        tool_stresses(options.folder, options.tool, frame=options.frame, path=options.path, scene=scene,
                      out=options.out or options.folder / options.tool, observer=progress)
    return 0


def _info(options) -> int:
    if options.folder is not None:
        from .results.results import Results
        print(Results.read(options.folder))
        return 0
    from importlib.metadata import PackageNotFoundError, version

    from . import __version__
    print(f"fenics_forming {__version__}")
    for name in ("fenics-dolfinx", "petsc4py", "gmsh", "numpy", "pydantic", "numba", "pyvista"):
        try:
            print(f"  {name:16s} {version(name)}")
        except PackageNotFoundError:
            print(f"  {name:16s} not found")
    return 0


def _say_on_one_rank(text: str, code: int) -> int:
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is None or mpi.COMM_WORLD.rank == 0:
        print(as_lines(text, sys.stderr), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
