"""Writes SCENE_REFERENCE.md from the JSON schema of scene files, the docstrings and `reasons.toml`.

    env/run python3 docs/make_scene_reference.py
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path

from fenics_forming.laws.described import Described
from fenics_forming.scene import Scene
from fenics_forming.units import format_quantity, kind_of

HERE = Path(__file__).parent
PAGE = HERE / "SCENE_REFERENCE.md"
TAGS = ("kind", "law")
MOST = 12      # words that are listed in a cell
INTRODUCTION = """# Scene reference

*Made from the schema by `env/run python3 docs/make_scene_reference.py`; do not edit.*

Every key of a scene file, part by part, with its default and the reason for it. A bare number is in mm, s, t, N, MPa, mJ,
°C, rad and what follows from them; a text such as `"30 kN"` is converted. A key without a default must be given; where
the default is —, leaving it out means what the reason says, or that there is no such thing. `forming check SCENE.toml` says
what is wrong with a scene; `forming check --schema` prints the schema for editors.
"""


@cache
def the_schema() -> dict:
    """JSON schema of scene files."""
    return Scene.json_schema()


def main() -> str:
    """The page."""
    schema = the_schema()
    parts = _parts(schema)
    lines = [INTRODUCTION, "## Parts", "", *(f"- [{title}](#{anchor(title)})" for title, _, _ in parts), ""]
    for title, model, tag in parts:
        lines += _section(title, model, tag, schema, {m.__name__: t for t, m, _ in parts})
    return "\n".join(lines).rstrip() + "\n"


@cache
def described() -> dict[str, type]:
    """Every part of a scene that the schema names, by name."""
    def below(parent):
        for child in parent.__subclasses__():
            yield child
            yield from below(child)

    names = set(the_schema()["$defs"])
    return {cls.__name__: cls for cls in below(Described)
            if cls.__name__ in names and cls.__module__.startswith("fenics_forming.")}


@cache
def reasons() -> dict[str, dict[str, str]]:
    """Reasons of defaults, by class and key."""
    return tomllib.loads((HERE / "reasons.toml").read_text(encoding="utf-8"))


def with_a_default() -> list[tuple[str, str]]:
    """(class, key) of all defaults that are a value, which want a reason."""
    found = []
    for name, model in described().items():
        for field_name, field in model.model_fields.items():
            default = None if field.is_required() else field.get_default(call_default_factory=True)
            if default is not None and default != () and field_name not in TAGS:
                found.append((name, field.alias or field_name))
    return sorted(found)


def _parts(schema) -> list[tuple[str, type, str]]:
    """(title, class, tag) of every part in the order in which a scene names them."""
    models, seen, queue, found = described(), set(), [("the scene itself", Scene, "")], []
    while queue:
        title, model, tag = queue.pop(0)
        if model in seen:
            continue
        seen.add(model)
        found.append((title, model, tag))
        properties = schema["properties"] if model is Scene else schema["$defs"][model.__name__]["properties"]
        here = "" if model is Scene else re.sub(r"^`\[?|\]?`$", "", title.split(" = ")[0].split(", ")[0]) + "."
        following = []
        for key, value in properties.items():
            for name, word in _referred(value):
                if name in models and models[name] not in seen:
                    several = ".NAME" if "additionalProperties" in value else ""
                    path = f"{here}{key}{several}"
                    made = f"`{path} = {{ {word[0]} = \"{word[1]}\" }}`" if word else f"`[{path}]`"
                    following.append((made, models[name], word[0] if word else ""))
        queue = following + queue if model is not Scene else queue + following
    return found


def _referred(value):
    """(name of a definition, its tag and word or None) in a piece of the schema, in order."""
    if not isinstance(value, (dict, list)):
        return
    if isinstance(value, list):
        for item in value:
            yield from _referred(item)
        return
    if "$ref" in value:
        name = value["$ref"].split("/")[-1]
        properties = the_schema()["$defs"][name].get("properties", {})
        yield name, next(((tag, properties[tag]["const"]) for tag in TAGS if "const" in properties.get(tag, {})), None)
    for key in ("anyOf", "oneOf", "items", "additionalProperties"):
        yield from _referred(value.get(key))


def _section(title, model, tag, schema, titles) -> list[str]:
    properties = schema["properties"] if model is Scene else schema["$defs"][model.__name__]["properties"]
    why, words = reasons().get(model.__name__, {}), told(model)
    rows = []
    for name, field in model.model_fields.items():
        key = field.alias or name
        if name in TAGS:
            continue
        what = words.get(name) or _of_its_table(properties[key])
        kind = _kind(properties[key], field, titles)
        default = "**must be given**" if field.is_required() else _default(field)
        rows.append(f"| `{key}` | {_cell(what)} | {kind} | {default} | {_cell(why.get(key, ''))} |")
    if not rows:
        rows = ["| | no further keys | | | |"]
    head = ["| Key | What it is | Value | Default | Why this default |", "|---|---|---|---|---|"]
    return [f"## {title}", "", _first_lines(model), "", *head, *rows, ""]


def _of_its_table(value) -> str:
    """What the one table is that a key holds."""
    tables = [name for name, word in _referred(value) if word is None]
    return _first_lines(described()[tables[0]]).split(". ")[0].rstrip(".") if len(tables) == 1 else ""


def _first_lines(model) -> str:
    """The docstring up to its parameters, as one paragraph."""
    text = (model.__doc__ or "").split("Parameters\n")[0].split("References\n")[0]
    text = re.sub(r":math:`([^`]*)`", r"$\1$", text)
    return " ".join(text.split()).replace("|", "\\|")


def told(model) -> dict[str, str]:
    """What the docstrings of a class and its bases say of each field, by name."""
    found = {}
    for cls in reversed([c for c in model.__mro__ if issubclass(c, Described) and c.__doc__]):
        text = " ".join(cls.__doc__.split())
        text = re.split(r" References -----", text)[0]
        text = re.split(r"Parameters -+ ", text)[-1]
        aliases = {field.alias: name for name, field in model.model_fields.items() if field.alias}
        names = "|".join(map(re.escape, sorted({*model.model_fields, *aliases}, key=len, reverse=True)))
        one = rf"(?:{names})(?: \(key `\w+`\))?"
        starts = list(re.finditer(rf"(?:^|(?<=[.;:] ))((?:{one}(?:, )?)+) : ", text))
        for here, following in zip(starts, [*starts[1:], None], strict=False):
            said = text[here.end(): following.start() if following else len(text)].strip(" ;")
            said = re.split(rf"(?<=\.) (?=\w+ … |(?:(?:{names})(?:, |\.))+)", said)[0]
            for name in re.findall(rf"\b(?:{names})\b", re.sub(r"\(key `\w+`\)", "", here[1])):
                found[aliases.get(name, name)] = said.rstrip(".")
    return found


def _kind(value, field, titles) -> str:
    """What a key may hold, in words and links."""
    links = []
    for name, word in _referred(value):
        title = titles.get(name)
        shown = f"`{word[1]}`" if word else "table"
        links.append(f"[{shown}](#{anchor(title)})" if title else shown)
    kind = kind_of(field.annotation) or next(filter(None, map(kind_of, field.metadata)), None)
    words = list(dict.fromkeys(links))
    if "additionalProperties" in value and words:
        return f"one {words[0]} for each name"
    if kind is not None:
        words.append(_quantity(value, kind))
    options = [f"`{_toml(option)}`" for option in _options(value)]
    words += options if len(options) <= MOST else [*options[:2], f"… {len(options)} in all"]
    if not words:
        words = sorted({_PLAIN[t] for t in _types(value) if t in _PLAIN}) or ["see left"]
    elif "boolean" in _types(value):
        words.insert(0, "`true`")
    listed = ", ".join(dict.fromkeys(words))
    return f"list of {listed}" if value.get("type") == "array" and links else listed


_PLAIN = {"string": "text", "boolean": "true or false", "integer": "whole number", "number": "number", "array": "list",
          "object": "table"}


def _quantity(value, kind) -> str:
    if value.get("type") == "array" and "maxItems" in value:
        low, high = value["minItems"], value["maxItems"]
        count = {2: "two", 3: "three"}
        numbers = count.get(low, low) if low == high else f"{count.get(low, low)} or {count.get(high, high)}"
        return f"{numbers} components, each {kind.expected}"
    return f"list, each {kind.expected}" if value.get("type") == "array" else kind.expected


def _options(value):
    """Words that a piece of the schema allows."""
    for piece in (value, *value.get("anyOf", ()), *value.get("oneOf", ())):
        yield from piece.get("enum", ())
        if "const" in piece:
            yield piece["const"]


def _types(value):
    found = {value.get("type")} if "type" in value else set()
    for piece in (*value.get("anyOf", ()), *value.get("oneOf", ())):
        found |= _types(piece)
    return found


def _default(field) -> str:
    value = field.get_default(call_default_factory=True)
    if value is None or value == () or value == {}:
        return "—"
    if isinstance(value, Described):
        tag = next((getattr(value, t) for t in TAGS if hasattr(value, t)), None)
        return f"`{tag}`" if tag else "the defaults below"
    kind = kind_of(field.annotation) or next(filter(None, map(kind_of, field.metadata)), None)
    numeric = isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind is not None and (numeric or isinstance(value, tuple)):
        return f"`{format_quantity(value, kind.unit)}`"
    return f"`{_toml(value)}`"


def _toml(value) -> str:
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) \
        else str(value)


def _cell(text) -> str:
    return text.replace("|", "\\|")


def anchor(title) -> str:
    """The address of a heading as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


if __name__ == "__main__":
    PAGE.write_text(main(), encoding="utf-8")
    print(PAGE)
