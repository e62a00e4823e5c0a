"""Runs the notebooks anew and keeps their outputs; stops where a cell fails, as an assert of a claim that does not hold.

    env/run python3 notebooks/run_all.py [NAME …] [--check]

NAME : the beginning of a notebook's name, such as 03; all of them without. --check : run them and write nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

HERE = Path(__file__).parent
LONGEST = 600      # s for a cell


def run(path: Path, *, write: bool) -> None:
    """Execute a notebook in its folder; its outputs replace those in the file."""
    notebook = nbformat.read(path, as_version=4)
    with kernel_of_this_python() as name:
        NotebookClient(notebook, timeout=LONGEST, kernel_name=name, resources={"metadata": {"path": str(HERE)}}).execute()
    for cell in notebook.cells:                       # times and progress of this machine are no content
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = joined([output for output in cell.outputs if output.get("name") != "stderr"])
    if write:
        nbformat.write(notebook, path)


@contextmanager
def kernel_of_this_python():
    """Name of a kernel that runs the Python of this program: that of the system knows nothing of a virtual environment."""
    with tempfile.TemporaryDirectory() as folder:
        kernel = Path(folder) / "kernels" / "here"
        kernel.mkdir(parents=True)
        command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        (kernel / "kernel.json").write_text(json.dumps({"argv": command, "display_name": "here", "language": "python"}))
        before = os.environ.get("JUPYTER_PATH")
        os.environ["JUPYTER_PATH"] = os.pathsep.join(filter(None, (folder, before)))
        try:
            yield "here"
        finally:
            os.environ.pop("JUPYTER_PATH") if before is None else os.environ.update(JUPYTER_PATH=before)


def joined(outputs: list) -> list:
    """The same outputs; what was printed in pieces is one piece, wherever the pieces fell."""
    made = []
    for output in outputs:
        if made and output.output_type == made[-1].output_type == "stream":
            made[-1].text += output.text
        else:
            made.append(output)
    return made


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*")
    parser.add_argument("--check", action="store_true", help="write nothing")
    options = parser.parse_args()
    failed = []
    for path in sorted(HERE.glob("*.ipynb")):
        if options.names and not path.name.startswith(tuple(options.names)):
            continue
        start = perf_counter()
        try:
            run(path, write=not options.check)
            print(f"{path.name}: {perf_counter() - start:.0f} s", flush=True)
        except CellExecutionError as error:
            failed.append(path.name)
            print(f"{path.name}: failed\n{error}", file=sys.stderr, flush=True)
    return len(failed)


if __name__ == "__main__":
    sys.exit(main())
