"""Fields that shapes share (points, directions, fillets) and what is refused in them."""

import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema

from ..laws.described import at_key
from ..units import Length, Number, Vector, kind_of, refused
from .outline import crossing_sides, rounded_pieces

Point = Vector(Length)
PlanePoint = Vector(Length, 2)
SpacePoint = Vector(Length, 3)
Direction = Vector(Number, 3)

_LENGTH = kind_of(Length)


def parsed_points(value):
    """Points of the plane as a tuple of pairs, mm."""
    expected = "a list of points such as [[0, 0], [10, 0], [10, 15]]"
    if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__len__"):
        raise refused(value, "is not a list", expected)
    for point in value:
        if isinstance(point, (str, bytes, dict)) or not hasattr(point, "__len__") or len(point) != 2:
            raise refused(point, "is not a point with two components", expected)
    return tuple(tuple(_LENGTH.parse(component) for component in point) for point in value)


def _fillet(value):
    if isinstance(value, (list, tuple)):
        return tuple(_fillet(radius) for radius in value)
    radius = _LENGTH.parse(value)
    if radius < 0:
        raise refused(value, "is negative", "a radius such as '2 mm', or one radius for each point")
    return radius


_NUMBER_OR_TEXT = {"anyOf": [{"type": "number"}, {"type": "string"}]}
Points = Annotated[
    tuple[tuple[float, float], ...],
    BeforeValidator(parsed_points),
    WithJsonSchema({"type": "array", "items": {"type": "array", "items": _NUMBER_OR_TEXT}}),
    _LENGTH,
]
Fillet = Annotated[
    Any,
    BeforeValidator(_fillet),
    WithJsonSchema({"anyOf": [*_NUMBER_OR_TEXT["anyOf"], {"type": "array", "items": _NUMBER_OR_TEXT}]}),
    _LENGTH,
]


def unit(vector):
    """The vector divided by its length, as an array."""
    return np.array(vector, dtype=float) / math.hypot(*vector)


def check_direction(key, vector):
    """Refuse a direction of zero length."""
    if not any(vector):
        example = [0] * (len(vector) - 1) + [1]
        raise at_key(key, f"has the length zero; expected a direction such as {example}", vector, "a direction")


def check_format(path, endings):
    """Refuse a file whose name does not end in one of `endings`."""
    if Path(path).suffix.lower() not in endings:
        allowed = ", ".join(ending[1:] for ending in endings)
        raise at_key("path", f"'{path}' has a format that cannot be read; allowed: {allowed}", path, allowed)


LEAST_EXTENT = 1e-12   # mm, and relative to the coordinates


def check_extent(low, high):
    """Refuse a rectangle or box whose upper corner does not lie above its lower one."""
    for number, (a, b) in enumerate(zip(low, high, strict=True), start=1):
        if not b - a > LEAST_EXTENT * max(1.0, abs(a), abs(b)):
            thickness = "negative" if b < a else "zero"
            sentence = f"component {number} is {b:g}, not above {a:g} of 'from': the thickness would be {thickness}"
            raise at_key("to", sentence, high, f"more than {a:g}")


def check_outline(points, *, closed):
    """Refuse an outline with duplicate points or crossing sides."""
    if closed and points[0] == points[-1]:
        raise at_key("points", "repeat the first point at the end; a polygon closes by itself", points[-1])
    for i, (a, b) in enumerate(pairwise(points), start=1):
        if a == b:
            raise at_key("points", f"hold the same point twice, as number {i} and {i + 1}", a)
    sides = crossing_sides(points, closed=closed)
    if sides is not None:
        first, second = (f"{i + 1}-{(i + 1) % len(points) + 1}" for i in sides)
        raise at_key("points", f"cross themselves: the sides {first} and {second} meet", points)


def check_fillet(fillet, corners, *, closed):
    """Refuse roundings that do not fit between the corners, or a wrong number of radii."""
    if isinstance(fillet, tuple) and len(fillet) != len(corners):
        raise at_key("fillet", f"has {len(fillet)} radii for {len(corners)} points; expected one for each", fillet)
    radii = np.broadcast_to(np.array(fillet, dtype=float), len(corners))
    try:
        rounded_pieces(corners, radii, closed=closed)
    except ValueError as error:
        number = error.args[0]
        at = ", ".join(f"{x:g}" for x in corners[number])
        sentence = f"is too large: {radii[number]:g} mm does not fit at the corner ({at})"
        raise at_key("fillet", sentence, fillet, "a smaller radius") from None
