"""Materials as data: one TOML file each in this folder, with the source of every number.

A file has a `title`, a `group`, the `condition` of the material, `generic` where it is nobody's measurement, the keys of
a scene's material in `[material]`, the range that the flow stress stands on in `[valid]`, and its `[[sources]]`:
what a source is `of`, its `citation`, and under `checked` where the numbers were read again, or "recalled".
"""

import tomllib
from functools import cache
from pathlib import Path

from ...units import List, NonNegative, Number, Rate, Temperature
from ..described import Described, unknown_word

FOLDER = Path(__file__).parent
RECALLED = "recalled"


class Range(Described):
    """Where a flow stress may be trusted: (lowest, highest) of each variable; one that is not given does not matter.

    Parameters
    ----------
    strain : effective strain. rate : 1/s. temperature : degC.
    """

    strain: List(NonNegative(Number), at_least=2) | None = None
    rate: List(NonNegative(Rate), at_least=2) | None = None
    temperature: List(Temperature, at_least=2) | None = None


class Source(Described):
    """Where numbers come from.

    Parameters
    ----------
    of : keys of the material. citation : the publication. checked : where they were read again, or "recalled": by heart.
    """

    of: tuple[str, ...]
    citation: str
    checked: str


class LibraryMaterial(Described):
    """A material of the library; prints as a page.

    Parameters
    ----------
    name : of its file. title, group, condition : in words. generic : stands for a class of materials and is nobody's
    measurement. material : the keys of a scene's material, as in the file. valid, sources : see there. note : a caution.
    """

    name: str
    title: str
    group: str
    condition: str
    generic: bool = False
    note: str = ""
    material: dict
    valid: Range = Range()
    sources: tuple[Source, ...] = ()

    @property
    def law(self):
        """Name of the flow-stress law, or "" for a material of tools."""
        return self.material.get("flow_stress", {}).get("law", "")

    @property
    def is_recalled(self):
        """Whether the numbers of the flow stress were not read again."""
        return any(source.checked == RECALLED for source in self.sources if "flow_stress" in source.of)

    def __hash__(self):
        return hash(self.name)

    def __repr__(self):
        return "\n".join(_page(self))

    __str__ = __repr__


class Library(dict):
    """The materials by name; prints as a table."""

    def __repr__(self):
        width = max(map(len, self), default=0)
        return "\n".join(f"{name:<{width}}  {entry.law or '-':<14}  {entry.title}" for name, entry in self.items())

    __str__ = __repr__


def names():
    """Names of the materials, in order."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


@cache
def _entry(name):
    values = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    return LibraryMaterial.read({"name": name, **values})


def library(name=None):
    """A material of the library, or all of them by name.

    Raises
    ------
    SceneError
        if there is none of that name; says which one is near.
    """
    if name is None:
        return Library({each: _entry(each) for each in names()})
    if name not in names():
        raise unknown_word(f"'{name}' is not a material of the library", name, names(), "")
    return _entry(name)


def _short(value):
    """A value as it is written; of a large table, how much there is of it."""
    if not isinstance(value, list) or len(str(value)) < 400:
        return value
    sizes, inner = [], value
    while isinstance(inner, list):
        sizes.append(str(len(inner)))
        inner = inner[0]
    return f"{' x '.join(sizes)} values in the file"


def _page(entry):
    import textwrap

    yield f"{entry.name}: {entry.title}"
    yield f"  {entry.condition}" + ("; generic, nobody's measurement" if entry.generic else "")
    yield from textwrap.wrap(entry.note, 78, initial_indent="  ", subsequent_indent="  ")
    for key, value in entry.material.items():
        words = ", ".join(f"{k} = {_short(v)}" for k, v in value.items()) if isinstance(value, dict) else value
        yield from textwrap.wrap(f"{key} = {words}", 78, initial_indent="    ", subsequent_indent="      ")
    for key, unit in (("strain", ""), ("rate", " 1/s"), ("temperature", " degC")):
        if (between := getattr(entry.valid, key)) is not None:
            yield f"  valid for a {key} from {between[0]:g} to {between[1]:g}{unit}"
    for source in entry.sources:
        text = f"{', '.join(source.of)}: {source.citation} ({source.checked})"
        yield from textwrap.wrap(text, 78, initial_indent="  ", subsequent_indent="    ")
