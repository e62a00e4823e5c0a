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


def messages_of_the_package():
    """The texts of the package and of env/run with … for what is filled in, joined as Python joins them."""
    def text(node):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            return node.value
        if isinstance(node, ast.JoinedStr):
            return "".join(text(part) if isinstance(part, ast.Constant) else "…" for part in node.values)
        return "…"

    found = [(DOCS.parent / "env" / "run").read_text(encoding="utf-8")]
    for path in sorted((DOCS.parent / "fenics_forming").rglob("*.py")):
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        found += [text(node) for node in nodes if isinstance(node, (ast.Constant, ast.JoinedStr))]
    return "\n".join(found)


def quoted_messages():
    """Messages that the page on troubleshooting quotes, in the first column of its tables."""
    page = (DOCS / "TROUBLESHOOTING.md").read_text(encoding="utf-8")
    rows = [line.split(" | ")[0] for line in page.splitlines() if line.startswith("| `")]
    return [message for row in rows for message in re.findall(r"`([^`]+)`", row)]


def test_messages_on_the_page_of_troubles_are_those_of_the_package():
    said = messages_of_the_package()
    pieces = {piece.strip(" '?:;") for message in quoted_messages() for piece in message.split("…")}
    stale = sorted(piece for piece in pieces if len(piece) > 3 and piece not in said)
    assert len(pieces) > 60 and not stale


def test_every_way_in_which_a_run_fails_is_on_the_page_of_troubles():
    """Of each ConvergenceError and MeshError with a text of its own, some part is quoted."""
    page = " ".join(quoted_messages())
    pieces = [piece.strip(" '?:;,") for message in quoted_messages() for piece in message.split("…")]
    missing = []
    for path in sorted((DOCS.parent / "fenics_forming").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            name = getattr(getattr(node, "func", None), "id", "")
            if name not in ("ConvergenceError", "MeshError") or not node.args:
                continue
            said = ast.unparse(node.args[0])
            words = [w for w in re.split(r"[{}\"']+", said) if len(w) > 20]
            if words and not any(len(p) > 8 and p in said for p in pieces) and not any(w.strip() in page for w in words):
                missing.append(f"{path.name}: {words[0]}")
    assert not missing, f"say in docs/TROUBLESHOOTING.md what to do: {missing}"


def test_the_gallery_shows_pictures_that_are_there():
    gallery = script("make_gallery")
    written = (DOCS / "GALLERY.md").read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)#]+)\)", written)
    assert len(gallery.demos()) > 7 and targets and all((DOCS / target).exists() for target in targets)
    assert len(re.findall(r"^!\[", written, re.M)) == len(re.findall(r"^## ", written, re.M))


def test_licence_and_version_are_the_same_everywhere():
    import tomllib

    import fenics_forming

    project = DOCS.parent
    citation = (project / "CITATION.cff").read_text(encoding="utf-8")
    licence = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]["license"]["text"]
    assert f"\nversion: {fenics_forming.__version__}\n" in citation and f"\nlicense: {licence}\n" in citation
    assert f"## {fenics_forming.__version__}" in (project / "CHANGELOG.md").read_text(encoding="utf-8")
    text = (project / "LICENSE").read_text(encoding="utf-8")
    assert "GNU LESSER GENERAL PUBLIC LICENSE" in text and "GNU GENERAL PUBLIC LICENSE" in text



def test_the_scene_that_the_readme_begins_with_is_fine_as_it_stands():
    import fenics_forming as ff

    assert ff.check(ff.read_scene(DOCS.parent / "demos" / "scenes" / "cup_extrusion.toml")) == []
