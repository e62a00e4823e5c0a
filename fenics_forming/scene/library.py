"""Materials of a scene that come from the library: `[materials.billet] from = "steel_1045"`, other keys overriding."""

from typing import Annotated

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from ..errors import did_you_mean
from ..laws.described import Described
from ..laws.library import library, names
from ..units import refused


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
    """A sentence where a body is outside the temperatures that its flow stress from the library stands on."""
    for name, body in scene.workpieces.items():
        material = scene.materials.get(body.material)
        entry = library(material.from_) if material is not None and material.from_ is not None else None
        if entry is None or material.wrote("flow_stress") or entry.valid.temperature is None:
            continue
        low, high = entry.valid.temperature
        if body.temperature is not None and not low <= body.temperature <= high:
            yield (f"workpieces.{name}.temperature: {body.temperature:g} degC is outside {low:g} to {high:g} degC, "
                   f"where the flow stress of '{entry.name}' is known")
