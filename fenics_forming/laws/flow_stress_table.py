"""The flow stress from a table over strain, and optionally strain rate and temperature, interpolated linearly."""

from functools import cached_property
from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema, model_validator

from ..errors import FormingError
from ..units import List, NonNegative, Number, Positive, Rate, Stress, Temperature, kind_of, refused
from .columns import read_columns
from .described import at_key
from .flow_stress import RATE_FLOOR, FlowStress
from .functions import is_ufl, zeros_like

_AXES = {"strain": NonNegative(Number), "rate": NonNegative(Rate), "temperature": Temperature}
_STRESS = kind_of(Positive(Stress))


def _nested(value):
    if isinstance(value, (list, tuple, np.ndarray)):
        return tuple(_nested(item) for item in value)
    return _STRESS.parse(value)


def _stresses(value):
    if not isinstance(value, (list, tuple, np.ndarray)):
        raise refused(value, "is not a list", "a list of stresses, nested as stress[strain][rate][temperature]")
    return _nested(value)


Stresses = Annotated[tuple[Any, ...], BeforeValidator(_stresses), WithJsonSchema({"type": "array"}), _STRESS]


class Table(FlowStress):
    """Flow stress by multilinear interpolation in a full grid; outside the grid the value of its edge holds.

    Give either `file`, a CSV file whose columns are named strain, stress and, if needed, rate and temperature (a unit
    may follow: "stress [MPa]"; rows in any order, every combination once), or `strain`, `stress` and, if needed,
    `rate` and `temperature` as lists with stress[strain][rate][temperature], axes that are not given left out.
    Between two rates stress is linear in the rate, or, with `rate_scale = "logarithmic"`, in its logarithm: hot metal
    measured at 0.01 and 1 1/s is half-way between the two at 0.1, not a tenth. Takes numbers and arrays, not UFL.

    Parameters
    ----------
    strain : rising, from 0. rate : rising, 1/s. temperature : rising, degC. stress : MPa.
    """

    law: Literal["table"] = "table"
    file: str | None = None
    strain: List(_AXES["strain"]) | None = None
    rate: List(_AXES["rate"]) | None = None
    temperature: List(_AXES["temperature"]) | None = None
    stress: Stresses | None = None
    rate_scale: Literal["linear", "logarithmic"] = "linear"
    depends_on_strain = True

    @property
    def depends_on_rate(self):
        return "rate" in self._grid[0]

    @property
    def depends_on_temperature(self):
        return "temperature" in self._grid[0]

    @model_validator(mode="after")
    def _is_a_grid(self):
        arrays = [name for name in ("strain", "rate", "temperature", "stress") if getattr(self, name) is not None]
        if self.file is not None and arrays:
            raise at_key("file", f"is given together with '{arrays[0]}'; give a file or lists, not both", self.file)
        if self.file is None and (self.strain is None or self.stress is None):
            absent = "strain" if self.strain is None else "stress"
            raise at_key(absent, "is missing; expected 'file', or the lists 'strain' and 'stress'")
        self._grid  # noqa: B018  (reads and checks the table now, before any mesh)
        return self

    @cached_property
    def _grid(self):
        axes, stress = self._from_file() if self.file is not None else self._from_lists()
        for name, axis in axes.items():
            if np.any(np.diff(axis) <= 0):
                raise at_key(
                    self._key(name), f"the {name}s are not rising: {_some(axis)}", _some(axis), "rising values"
                )
        if self.rate_scale == "logarithmic":
            if "rate" not in axes:
                raise at_key("rate_scale", "has no effect in a table without rates")
            if axes["rate"][0] <= 0:
                raise at_key(self._key("rate"), "0 has no logarithm; begin the rates above it", 0, "positive rates")
            axes["rate"] = np.log(axes["rate"])
        return axes, stress

    def _key(self, name):
        return "file" if self.file is not None else name

    def _from_lists(self):
        given = {name: getattr(self, name) for name in _AXES}
        axes = {name: np.array(axis) for name, axis in given.items() if axis is not None}
        wanted = tuple(len(axis) for axis in axes.values())
        try:
            stress = np.array(self.stress, dtype=float)
        except ValueError:
            stress = np.zeros(0)
        if stress.shape != wanted:
            shape = " x ".join(str(size) for size in wanted)
            raise at_key("stress", f"does not hold {shape} values over {' x '.join(axes)}", allowed=wanted)
        return axes, stress

    def _from_file(self):
        columns = read_columns(self.file, {name: kind_of(q) for name, q in _AXES.items()} | {"stress": _STRESS})
        for name in ("strain", "stress"):
            if name not in columns:
                raise at_key("file", f"'{self.file}' has no column '{name}'", allowed=["strain", "stress"])
        axes = {name: np.unique(columns[name]) for name in _AXES if name in columns}
        stress = np.full([len(axis) for axis in axes.values()], np.nan)
        stress[tuple(np.searchsorted(axis, columns[name]) for name, axis in axes.items())] = columns["stress"]
        if np.isnan(stress).any() or stress.size != len(columns["stress"]):
            raise at_key("file", f"'{self.file}' is no full grid: every combination of {', '.join(axes)} exactly once")
        return axes, stress

    def __call__(self, strain, rate, temperature=None):
        return self._interpolated(strain, rate, temperature, slope_along=None)

    def rate_derivative(self, strain, rate, temperature=None):
        """Slope of the cell that holds the rate (the right one at a grid line); 0 outside the table."""
        if not self.depends_on_rate:
            return zeros_like(strain, rate, temperature)
        return self._interpolated(strain, rate, temperature, slope_along="rate")

    def _interpolated(self, strain, rate, temperature, *, slope_along):
        if any(map(is_ufl, (strain, rate, temperature))):
            raise FormingError("the table law takes numbers and arrays, not UFL expressions; evaluate it at points")
        axes, stress = self._grid
        scaled, slope = self._scaled(rate)
        points = {"strain": strain, "rate": scaled, "temperature": temperature}
        if self.depends_on_temperature:
            self._needed(temperature)
        # one pair of (grid index, weight) per axis; the value is the sum over all corners of the cell
        pairs = [
            _slopes(axis, points[name]) if name == slope_along else _weights(axis, points[name])
            for name, axis in axes.items()
        ]
        total = zeros_like(strain, rate, temperature)
        for corner in product(*pairs):
            weight = 1.0
            for _, factor in corner:
                weight = weight * factor
            total = total + weight * stress[tuple(index for index, _ in corner)]
        return total if slope_along is None else total * slope

    def _scaled(self, rate):
        """The rate as its axis counts it, and the slope of that over the rate."""
        if self.rate_scale == "linear":
            return rate, 1.0
        rate = np.maximum(rate, RATE_FLOOR)
        return np.log(rate), 1.0 / rate


def _weights(axis, value):
    if len(axis) == 1:
        return [(np.zeros(np.shape(value), dtype=int), 1.0)]
    value = np.clip(value, axis[0], axis[-1])
    cell = _cell(axis, value)
    fraction = (value - axis[cell]) / (axis[cell + 1] - axis[cell])
    return [(cell, 1.0 - fraction), (cell + 1, fraction)]


def _slopes(axis, value):
    if len(axis) == 1:
        return [(np.zeros(np.shape(value), dtype=int), 0.0)]
    cell = _cell(axis, value)
    inside = (np.asarray(value) >= axis[0]) & (np.asarray(value) < axis[-1])
    slope = np.where(inside, 1.0 / (axis[cell + 1] - axis[cell]), 0.0)
    return [(cell, -slope), (cell + 1, slope)]


def _cell(axis, value):
    return np.clip(np.searchsorted(axis, value, side="right") - 1, 0, len(axis) - 2)


def _some(axis):
    return ", ".join(f"{value:g}" for value in axis[:5]) + (", …" if len(axis) > 5 else "")
