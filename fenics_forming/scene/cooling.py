"""Operations between blows in which nothing is formed: the body cools in the air, or on some of its tools."""

from typing import Annotated

from pydantic import BeforeValidator

from ..errors import SceneError
from ..laws.described import Described, unknown_word
from ..units import CountFrom, NonNegative, Positive, Time, refused


class Cooling(Described):
    """A pause of the process; its clock, and so every drive, stands still.

    Parameters
    ----------
    at : time of the process, s; 0 is before the first blow. time : how long it lasts, s. steps : of heat in it.
    on : names of the tools that the body lies on meanwhile; in the air all around if not given.
    """

    at: NonNegative(Time) = 0.0
    time: Positive(Time)
    steps: CountFrom(1) = 20
    on: tuple[str, ...] = ()


def _operations(value):
    if isinstance(value, (dict, Cooling)):
        return (value,)
    if not isinstance(value, (list, tuple)):
        raise refused(value, "is not a list", "a table such as { at = 0, time = '5 s' }, or a list of them")
    return tuple(value)


Coolings = Annotated[tuple[Cooling, ...], BeforeValidator(_operations)]


def cooling_problems(scene):
    """SceneErrors of operations that cannot be."""
    for number, operation in enumerate(scene.process.cooling):
        key = f"process.cooling.{number}"
        for name in operation.on:
            if name not in scene.tools:
                yield unknown_word(f"'{name}' is not the name of a tool", name, scene.tools, f"{key}.on")
        if number and operation.at < scene.process.cooling[number - 1].at:
            yield SceneError("lies before the operation in front of it; expected them in the order of time",
                             key=f"{key}.at", got=operation.at)
        if not scene.process.flow:
            yield SceneError("is a pause of a flow; a run without flow cools all the time", key=key, allowed="flow = true")
    if scene.process.cooling and scene.process.heat is False:
        yield SceneError("needs temperatures that change, and process.heat is false", key="process.cooling")
