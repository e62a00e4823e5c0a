"""Fields of a scene that hold names: tables by name, and lists of axes."""

import re
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, WithJsonSchema

from ..laws.described import at_key
from ..units import refused, shown


class Named(dict):
    """A frozen dict from the user's names to what they stand for."""

    def _frozen(self, *_, **__):
        raise TypeError("a scene is frozen; build a new one with scene.replaced(...)")

    __setitem__ = __delitem__ = clear = pop = popitem = setdefault = update = __ior__ = _frozen

    def __hash__(self):
        return hash(tuple(self.items()))

    def __reduce__(self):
        return Named, (dict(self),)


def _names(value):
    if not isinstance(value, dict):
        raise refused(value, "is not a table", "one table for each name")
    for name in value:
        if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            allowed = "a letter, then letters, digits and underscores, such as 'upper_die'"
            raise at_key(str(name), f"{shown(name)} is no name; expected {allowed}", name, allowed)
    return value


def named(described):
    """Annotation of a frozen dict from names to descriptions."""
    return Annotated[dict[str, described], BeforeValidator(_names), AfterValidator(Named)]


def _axes(value):
    if isinstance(value, str) or not isinstance(value, (list, tuple)):
        raise refused(value, "is not a list", "a list of axes such as ['z']")
    for number, axis in enumerate(value):
        if axis not in ("x", "y", "z", "r"):
            raise refused(axis, "is no axis", "axes of the geometry, such as 'z'")
        if axis in value[:number]:
            raise refused(axis, "is given twice", "every axis once")
    return tuple(value)


_AXIS_LIST = {"type": "array", "items": {"enum": ["x", "y", "z"]}}
Axes = Annotated[tuple[str, ...], BeforeValidator(_axes), WithJsonSchema(_AXIS_LIST)]
