"""A tool that moves by a table of displacement or speed over time."""

import math
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from ...units import Length, List, Number, Speed, Time, Vector, kind_of
from ..columns import read_columns
from ..described import at_key
from .drive import Translation, check_direction, check_spin, unit


class TableDrive(Translation):
    """Displacement or speed along a direction from a table, linear between its times; at rest before and after it.

    Give `times` with `displacement` or `speed`, or `file`, a CSV file with the columns time and displacement or speed
    (a unit may follow: "time [s]"). Where the velocity jumps, the value is that of the later interval.

    Parameters
    ----------
    direction : a direction of any length. times : s, rising from 0. displacement : mm, from 0. speed : mm/s.
    rotation : optional `Spin`, or a table of its keys.
    """

    kind: Literal["table"] = "table"
    given_direction: Vector(Number) = Field(alias="direction")
    file: str | None = None
    times: List(Time, at_least=2) | None = None
    given_displacement: List(Length, at_least=2) | None = Field(None, alias="displacement")
    given_speed: List(Speed, at_least=2) | None = Field(None, alias="speed")

    @model_validator(mode="after")
    def _is_a_table(self):
        check_spin(self.rotation, len(self.given_direction))
        check_direction(self.given_direction)
        self._pieces  # noqa: B018  (reads and checks the table now, before any mesh)
        return self

    def _columns(self):
        lists = {"time": self.times, "displacement": self.given_displacement, "speed": self.given_speed}
        given = {name: np.array(values) for name, values in lists.items() if values is not None}
        if self.file is not None:
            if given:
                raise at_key("file", "is given together with lists; give a file or lists, not both", self.file)
            kinds = {"time": kind_of(Time), "displacement": kind_of(Length), "speed": kind_of(Speed)}
            return read_columns(self.file, kinds), dict.fromkeys(lists, "file")
        return given, {"time": "times", "displacement": "displacement", "speed": "speed"}

    @cached_property
    def _pieces(self):
        """Times, displacements and speeds at the start of each interval, its acceleration, the stroke so far."""
        columns, keys = self._columns()
        if "time" not in columns:
            raise at_key(keys["time"], "is missing; expected the list of times, from 0 on", allowed="times")
        if ("displacement" in columns) == ("speed" in columns):
            both = "both given; give one" if "speed" in columns else "both missing; give one"
            raise at_key(keys["displacement"], f"'displacement' and 'speed' are {both}")
        times = columns["time"]
        name = "displacement" if "displacement" in columns else "speed"
        values = columns[name]
        if len(values) != len(times) or len(times) < 2:
            raise at_key(keys[name], f"has {len(values)} values for {len(times)} times; at least two, one per time")
        if times[0] != 0 or np.any(np.diff(times) <= 0):
            raise at_key(keys["time"], "are not rising from 0", times.tolist(), "rising times, the first 0")
        if name == "displacement" and values[0] != 0:
            raise at_key(keys[name], f"starts at {values[0]:g}, not at 0: the tool is drawn where it starts")
        return _pieces_of_displacement(times, values) if name == "displacement" else _pieces_of_speed(times, values)

    @property
    def dimension(self):
        return len(self.given_direction)

    @property
    def direction(self):
        _, _, speed, acceleration, _ = self._pieces
        first = np.flatnonzero((speed[:-1] != 0) | (acceleration != 0))
        if not len(first):
            return None
        sign = np.sign(speed[first[0]] or acceleration[first[0]])
        return sign * unit(self.given_direction)

    @property
    def turning_times(self):
        times, _, speed, acceleration, _ = self._pieces
        middle = speed[:-1] + acceleration * np.diff(times) / 2
        ways = np.concatenate([np.sign(middle), [0.0]])    # of the intervals, at rest behind the last
        return tuple(float(t) for t in times[1:][ways[1:] != ways[:-1]])

    def velocity(self, time):
        times, _, speed, acceleration, _ = self._pieces
        if not times[0] <= time < times[-1]:
            return np.zeros(self.dimension)
        i = self._interval(time)
        return (speed[i] + acceleration[i] * (time - times[i])) * unit(self.given_direction)

    def displacement(self, time):
        times, shift, speed, acceleration, _ = self._pieces
        i, late = self._interval(time), min(max(time, times[0]), times[-1])
        late -= times[i]
        return (shift[i] + (speed[i] + acceleration[i] * late / 2) * late) * unit(self.given_direction)

    def travel(self, time):
        times, _, speed, acceleration, stroke = self._pieces
        i, late = self._interval(time), min(max(time, times[0]), times[-1])
        late -= times[i]
        return float(stroke[i] + abs((speed[i] + acceleration[i] * late / 2) * late))

    def time_of_travel(self, travel, start=0.0):
        times, _, speed, acceleration, stroke = self._pieces
        if travel <= self.travel(start):
            return start
        if travel > stroke[-1]:
            return math.inf
        i = int(np.searchsorted(stroke, travel, side="left")) - 1
        sign = 1.0 if speed[i] > 0 or (speed[i] == 0 and acceleration[i] > 0) else -1.0
        first, growth, rest = sign * speed[i], sign * acceleration[i], travel - stroke[i]
        # the root that does not cancel: first * t + growth * t^2 / 2 = rest
        return float(times[i] + 2 * rest / (first + math.sqrt(max(first**2 + 2 * growth * rest, 0.0))))

    def _interval(self, time):
        times = self._pieces[0]
        return int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2))


def _pieces_of_displacement(times, shift):
    speed = np.diff(shift) / np.diff(times)
    stroke = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(shift)))])
    return times, shift, np.append(speed, 0.0), np.zeros(len(speed)), stroke


def _pieces_of_speed(times, speed):
    # a node where the speed changes sign, so that the stroke grows monotonically within every interval
    turns = np.flatnonzero(speed[:-1] * speed[1:] < 0)
    share = speed[turns] / (speed[turns] - speed[turns + 1])
    crossings = times[turns] + share * np.diff(times)[turns]
    between = (crossings > times[turns]) & (crossings < times[turns + 1])      # not rounded onto a node
    turns = turns[between]
    times = np.insert(times, turns + 1, crossings[between])
    speed = np.insert(speed, turns + 1, 0.0)
    step = np.diff(times)
    increments = (speed[1:] + speed[:-1]) / 2 * step
    shift = np.concatenate([[0.0], np.cumsum(increments)])
    stroke = np.concatenate([[0.0], np.cumsum(np.abs(increments))])
    return times, shift, speed, np.diff(speed) / step, stroke
