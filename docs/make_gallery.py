"""Writes GALLERY.md: every demo with its picture, what it shows, and how to run it.

    env/run python3 docs/make_gallery.py [--fresh]

A demo whose picture is neither in `results/` nor in `docs/pictures/` is run first; with --fresh all of them are. Pictures
in `results/` count before those in `docs/pictures/`, which are their copies.
"""

from __future__ import annotations

import argparse
import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
PROJECT = HERE.parent
PICTURES = HERE / "pictures"
PAGE = HERE / "GALLERY.md"
INTRODUCTION = """# Gallery

*Made by `make gallery`; do not edit.*

Each demo is a short program to read and change. It runs a process, compares it with reference values, draws this picture
and fails where it does not agree.
"""


def demos() -> list[Path]:
    """The programs of the folder demos that draw a picture, in order."""
    return [path for path in sorted((PROJECT / "demos").glob("*.py")) if picture_name(path)]


def picture_name(demo: Path) -> str | None:
    """Name of the picture that a demo leaves in its folder of results."""
    found = re.search(r"""Path\(out\) / "(\w+\.png)\"""", demo.read_text(encoding="utf-8"))
    return found and found[1]


def page() -> str:
    """The page, of the demos that have a picture."""
    parts = [INTRODUCTION]
    for demo in demos():
        if not (PICTURES / picture_name(demo)).exists():
            continue
        first, _, rest = ast.get_docstring(ast.parse(demo.read_text(encoding="utf-8"))).partition("\n")
        scene = PROJECT / "demos" / "scenes" / f"{demo.stem}.toml"
        files = f"[demos/{demo.name}](../demos/{demo.name})"
        files += f", scene [{scene.name}](../demos/scenes/{scene.name})" if scene.exists() else ""
        told = "\n\n".join(part for part in rest.strip("\n").split("\n\n") if not re.match(r"\s*(python3|mpirun)", part))
        parts.append(f"## {demo.stem.replace('_', ' ').capitalize()}\n\n**{first.strip()}** {_unwrapped(told)}\n\n"
                     f"![{first.strip()}](pictures/{picture_name(demo)})\n\n`python3 demos/{demo.name}` · {files}\n")
    return "\n".join(parts)


def _unwrapped(text: str) -> str:
    """Paragraphs as one line each; those that are indented, formulas, as they are."""
    made = []
    for part in text.split("\n\n"):
        if part.startswith("    "):
            made.append(part)
        else:
            line = " ".join(part.split()).replace("``", "`")
            made.append(re.sub(r":math:`([^`]*)`", r"$\1$", line))
    return "\n\n".join(made)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fresh", action="store_true", help="run every demo anew")
    fresh = parser.parse_args().fresh
    for demo in demos():
        made = PROJECT / "results" / demo.stem / picture_name(demo)
        if fresh or not (made.exists() or (PICTURES / made.name).exists()):
            subprocess.run([sys.executable, str(demo)], check=True, cwd=PROJECT)
        if made.exists():
            shutil.copyfile(made, PICTURES / made.name)
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)


if __name__ == "__main__":
    main()
