"""A scene as a tree with units, for `print(scene)` and notebooks."""

import re
import textwrap

from ..laws.described import Described, is_default, shown_with_unit


def tree(scene):
    """Lines such as "│   ├── mesh_size: 1 mm", without the parts that the scene does not name."""
    lines = [f"Scene: {scene.title}" if scene.title else "Scene", f"├── geometry: {scene.geometry}"]
    parts = [
        (name, getattr(scene, name))
        for name, field in type(scene).model_fields.items()
        if name not in ("title", "geometry") and not is_default(getattr(scene, name), field)
    ]
    lines += _branches(parts)
    return "\n".join(lines)


def broken(text, width):
    """The lines of a tree, those that are longer than ``width`` broken between words and set in below their names."""
    return "\n".join(
        textwrap.fill(line, width, subsequent_indent=re.match(r"[│├└─ ]*", line)[0].translate(_BELOW) + "  ",
                      break_long_words=False, break_on_hyphens=False)
        for line in text.splitlines()
    )


_BELOW = str.maketrans({"├": "│", "└": " ", "─": " "})


def _branches(parts, indent=""):
    lines = []
    for number, (name, value) in enumerate(parts):
        last = number == len(parts) - 1
        stem, below = ("└── ", "    ") if last else ("├── ", "│   ")
        if isinstance(value, dict):
            lines.append(f"{indent}{stem}{name}")
            lines += _branches(list(value.items()), indent + below)
        elif isinstance(value, Described) and not {"kind", "law"} & set(type(value).model_fields):
            lines.append(f"{indent}{stem}{name}")
            lines += _branches(_given(value), indent + below)
        else:
            lines.append(f"{indent}{stem}{name}: {value}")
    return lines


def _given(described):
    parts = []
    for name, field in type(described).model_fields.items():
        value = getattr(described, name)
        if is_default(value, field):
            continue
        if isinstance(value, tuple) and value and isinstance(value[0], str):
            value = ", ".join(value)
        shown = value if isinstance(value, (dict, Described)) else shown_with_unit(value, field)
        parts.append((field.alias or name, _bare(shown)))
    return parts


def _bare(value):
    return value.strip("'") if isinstance(value, str) else value
