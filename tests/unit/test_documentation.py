"""Pages that are made from the code are up to date, and what pages show runs."""

import ast
import importlib.util
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


def script(name):
    """A script of the folder docs as a module."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def reference():
    return script("make_scene_reference")


def test_the_scene_reference_is_that_of_the_schema(reference):
    written = (DOCS / "SCENE_REFERENCE.md").read_text(encoding="utf-8")
    assert reference.main() == written, "write it anew: env/run python3 docs/make_scene_reference.py"


def test_every_default_has_its_reason_and_every_reason_its_default(reference):
    reasons = {(name, key) for name, keys in reference.reasons().items() for key in keys}
    missing = [f"[{name}] {key}" for name, key in reference.with_a_default() if (name, key) not in reasons]
    assert not missing, f"say in docs/reasons.toml why: {', '.join(missing)}"
    models = reference.described()
    stale = [f"{name}.{key}" for name, key in reasons if name not in models or key not in models[name].key_names()]
    assert not stale


def test_links_within_the_reference_have_their_headings(reference):

    text = reference.main()
    headings = {reference.anchor(line[3:]) for line in text.splitlines() if line.startswith("## ")}
    assert set(re.findall(r"\]\(#([^)]+)\)", text)) <= headings


def test_what_the_page_on_extending_shows_runs_and_is_short():
    """Block after block in one namespace; every class or function of an extension has fewer than twenty lines."""
    blocks = re.findall(r"^```python\n(.*?)^```", (DOCS / "EXTENDING.md").read_text(encoding="utf-8"), re.S | re.M)
    namespace = {"__name__": "extending"}
    for number, block in enumerate(blocks):
        exec(compile(block, f"EXTENDING.md, block {number}", "exec"), namespace)
        for node in ast.parse(block).body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                assert node.end_lineno - node.lineno < 20, node.name
    assert {"HockettSherby", "AcceleratedDrive", "viscous_bed"} <= set(namespace)
