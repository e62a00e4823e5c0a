"""Materials of a scene that come from the library: `[materials.billet] from = "steel_1045"`, other keys overriding."""

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from ..errors import did_you_mean
from ..laws.described import Described
from ..laws.library import library, names
from ..units import refused

FAR = 3.0
"""Times the greatest rate of the data from which on it is said: the rate grows as the body becomes flat, and at corners."""


def _known(name):
    if name not in names():
        hint = did_you_mean(name, names())
        raise refused(name, f"is not in the library{'; ' + hint if hint else ''}", "a name that `forming materials` lists")
    return name


LibraryName = Annotated[str, AfterValidator(_known), WithJsonSchema({"type": "string", "enum": names()})]


class FromLibrary(Described):
    """Base of a description whose keys may come from the library; what the user writes counts before what is there.

    A table of the user without its tag, such as flow_stress = { n = 0.3 }, changes single parameters of the library's.
    """

    from_: LibraryName | None = Field(None, alias="from")

    @model_validator(mode="before")
    @classmethod
    def _with_the_keys_of_the_library(cls, values):
        name = values.get("from", values.get("from_")) if isinstance(values, dict) else None
        if not isinstance(name, str) or name not in names():
            return values
        merged = dict(library(name).material)
        for key, value in values.items():
            there = merged.get(key)
            parameters = isinstance(value, dict) and isinstance(there, dict) and "law" not in value
            merged[key] = there | value if parameters else value
        return merged

    def from_library(self):
        """The same without the user's own keys; None where nothing comes from the library."""
        return None if self.from_ is None else type(self)(from_=self.from_)

    def wrote(self, key):
        """Whether the user wrote the key, and not the library."""
        there = self.from_library()
        return self.says(key) and (there is None or getattr(there, key) != getattr(self, key))

    def as_table(self):
        """The table as the user wrote it: keys that are as in the library are left to it."""
        table, there = super().as_table(), self.from_library()
        if there is None:
            return table
        same = Described.as_table(there)
        return {key: value for key, value in table.items() if key == "from" or same.get(key) != value}


def library_warnings(scene):
    """A sentence where a body is outside the temperatures, or formed far faster than the rates, of its data."""
    for name, body in scene.workpieces.items():
        material = scene.materials.get(body.material)
        entry = library(material.from_) if material is not None and material.from_ is not None else None
        if entry is None or material.wrote("flow_stress"):
            continue
        if entry.valid.temperature is not None and body.temperature is not None:
            low, high = entry.valid.temperature
            if not low <= body.temperature <= high:
                yield (f"workpieces.{name}.temperature: {body.temperature:g} degC is outside {low:g} to {high:g} degC, "
                       f"where the flow stress of '{entry.name}' is known")
        if entry.valid.rate is not None and (rate := _first_rate(scene, body)) > FAR * entry.valid.rate[1]:
            yield (f"workpieces.{name}.material: the tools form it at some {rate:.2g} 1/s to begin with; the flow stress "
                   f"of '{entry.name}' is known up to {entry.valid.rate[1]:g} 1/s")


def _first_rate(scene, body):
    """Greatest speed of a tool over the extent of the body along its way, 1/s: the rate of upsetting as it begins."""
    if body.shape.kind == "file":
        return 0.0
    low, high = np.asarray(body.shape.bounds(), float)
    rates = [0.0]
    for name in scene.driven_tools:
        drive = scene.drive(name)
        if drive.direction is not None:
            velocity = np.asarray(drive.velocity(0.0), float)
            along = np.abs(velocity) @ (high - low)
            rates.append(float(velocity @ velocity / along) if along > 0 else 0.0)
    return max(rates)
