"""Notebooks are committed with their outputs, claim something, and say what to change.

`make notebooks` runs all of them anew; the long test those that take less than ten seconds of CPU time.
"""

import importlib.util
import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


@each_notebook
def test_a_notebook_shows_its_outputs_asserts_its_claim_and_ends_with_a_change_to_make(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    outputs = [output for cell in code for output in cell["outputs"]]
    assert all(cell["execution_count"] == number + 1 for number, cell in enumerate(code)), "run from top to bottom, once"
    assert outputs and not any(output["output_type"] == "error" for output in outputs)
    assert any("image/png" in output.get("data", {}) for output in outputs), "it has a picture"
    assert any("assert " in "".join(cell["source"]) for cell in code)
    assert cells[-1]["cell_type"] == "markdown" and "**Now change …**" in "".join(cells[-1]["source"])
    assert path.stat().st_size < 600_000


def test_there_are_the_eleven_notebooks():
    assert [int(path.name[:2]) for path in NOTEBOOKS] == list(range(1, 12))


def test_no_machine_is_named_in_what_notebooks_show():
    for path in NOTEBOOKS:
        text = path.read_text(encoding="utf-8")
        assert "/home/" not in text and "/tmp/" not in text and "/root/" not in text, path.name


QUICK = ("01", "02", "03", "04", "06", "10")


@pytest.mark.long
@pytest.mark.parametrize("path", [path for path in NOTEBOOKS if path.name.startswith(QUICK)], ids=lambda path: path.stem)
def test_what_a_notebook_claims_holds(path):
    spec = importlib.util.spec_from_file_location("run_all", FOLDER / "run_all.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.run(path, write=False)
