"""Scene files: reading and writing TOML, with `--set dotted.key=value`."""

import tomllib
from pathlib import Path

from ..errors import SceneError
from .description import Scene
from .toml_text import toml_text


def read_scene(path, *, set=()):
    """The scene of a TOML file.

    Parameters
    ----------
    path : the file; paths in it are relative to its folder.
    set : changes as "dotted.key=value"; the value is read as TOML, or else taken as a text.

    Raises
    ------
    SceneError, for a file that is not there or not TOML, or keys and values that cannot be meant. Whether the scene
    makes sense as a whole is asked with `check`.
    """
    path = Path(path)
    values = _parsed(path)
    for change in set:
        _apply(change, values)
    return Scene.read(_with_paths(values, lambda name: str(path.parent.absolute() / name)))


def write_scene(scene, path):
    """Write the scene as TOML; files below the folder of `path` are named relative to it."""
    path = Path(path)
    folder = path.parent.absolute()

    def shortened(name):
        return str(Path(name).relative_to(folder)) if Path(name).is_relative_to(folder) else name

    path.write_text(toml_text(_with_paths(scene.as_table(), shortened)), encoding="utf-8")


def _parsed(path):
    text = ""
    try:
        text = path.read_text(encoding="utf-8")
        return tomllib.loads(text)
    except FileNotFoundError:
        raise SceneError(f"the scene file '{path}' does not exist", got=str(path)) from None
    except tomllib.TOMLDecodeError as error:
        reason, _, place = str(error).partition(" (at ")
        where = place.rstrip(")").replace("end of document", f"the end, line {text.count(chr(10)) or 1}")
        reason = reason[0].lower() + reason[1:]
        raise SceneError(f"'{path.name}' is not valid TOML ({where}): {reason}", got=str(path)) from None
    except UnicodeDecodeError:
        raise SceneError(f"'{path.name}' is not a text in UTF-8", got=str(path)) from None
    except (ValueError, RecursionError):  # numbers of thousands of digits, tables nested thousands deep
        raise SceneError(f"'{path.name}' is not a scene: a number or a nesting is too long", got=str(path)) from None
    except OSError as error:
        raise SceneError(f"'{path}' cannot be read: {error.strerror}", got=str(path)) from None


def _apply(change, values):
    key, equals, text = change.partition("=")
    words = key.strip().split(".")
    if not equals or not all(words):
        raise SceneError("is not of the form dotted.key=value", key=f"--set {change}", got=change)
    try:
        value = tomllib.loads(f"value = {text.strip()}")["value"]
    except (ValueError, RecursionError):
        value = text.strip()
    here = values
    for number, word in enumerate(words[:-1]):
        here = here.setdefault(word, {})
        if not isinstance(here, dict):
            above = ".".join(words[: number + 1])
            raise SceneError(f"'{above}' holds a value, not a table", key=f"--set {key.strip()}", got=change)
    here[words[-1]] = value


def _with_paths(values, change):
    """The same nested tables with `change` applied to the name of every file."""
    if isinstance(values, list):
        return [_with_paths(item, change) for item in values]
    if not isinstance(values, dict):
        return values
    return {
        key: change(value) if isinstance(value, str) and _names_a_file(key, values) else _with_paths(value, change)
        for key, value in values.items()
    }


def _names_a_file(key, table):
    return (key == "file" and "table" in (table.get("law"), table.get("kind"))) or (
        key == "path" and table.get("kind") in ("file", "stl")
    )
