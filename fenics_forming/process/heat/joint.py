"""A workpiece and all that warms up with it as one network, on rank 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...physics.thermal import columns
from ...physics.thermal.bed import Bed
from ...physics.thermal.network import Network, Radiation, Surroundings
from ...physics.thermal.pairing import conductances
from .tool_field import ToolHeat, Touch, Waiting


class Joint:
    """The vertices of a workpiece, of the tools that have a mesh, and the columns of those that stand on some.

    Parameters
    ----------
    network : capacities, pairs and conductances of the workpiece · start : its temperatures · given : heat, mJ
    outside, radiation : by name, conductance or area, and temperature there
    """

    def __init__(self, network, start, given, outside, radiation):
        self._parts, self._starts, self._given = [network], [start], [given]
        self._outside, self._radiation = outside, radiation
        self._meshes: dict[str, tuple] = {}                             # tool → its first vertex, what waits in it
        self._beds: dict[str, tuple[int, Bed]] = {}                     # tool → its first column, its columns
        self._couplings: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._meetings: dict[str, tuple[np.ndarray, np.ndarray, float]] = {}

    def add_meeting(self, name: str, pairs: np.ndarray, strength: np.ndarray, outwards: float):
        """Pairs of vertices of two workpieces that touch; ``outwards`` the sign of heat from the first of a pair."""
        self._meetings[name] = pairs, strength, outwards

    def add(self, name: str, exchange, tool: ToolHeat, temperature: np.ndarray, waiting: Waiting, touch: Touch | None,
            rubbed, dt: float):
        """A tool, its vertices behind those that are there; ``rubbed`` (v,) mJ, friction heat that it gets where vertices
        of the workpiece touch it; ``exchange`` a ``heat_surface.ToolExchange``.

        Its own step over, heat is conducted inside it for all the time of that. Until then a vertex that is touched answers
        what it has been given as the column below it does, the temperatures being those of the last conduction.
        """
        own, pairs, conductance = tool.network
        between = None if touch is None else tool.pairs(touch)
        time, is_due = waiting.time + dt, waiting.steps + 1 >= tool.law.every
        capacity = own
        if is_due:
            conductance = time / dt * conductance
        else:
            pairs, conductance = pairs[:0], conductance[:0]
            if between is not None:
                area = np.bincount(between[0][:, 1], between[1], tool.count) / exchange.law.coefficient
                capacity = np.maximum(own, area * exchange.effusivity * time / columns.resistance(time))
        start = temperature + waiting.held / capacity
        first = self._append(name, (capacity, pairs, conductance), start, between, rubbed)
        self._meshes[name] = first, None if is_due else (temperature, capacity, Waiting(waiting.steps + 1, time, own))

    def add_columns(self, name: str, exchange, bed: Bed, touch: Touch | None, rubbed, dt: float):
        """The columns of a tool, in a step of ``dt``, s; ``exchange`` a ``heat_surface.ToolExchange``, the rest as
        above."""
        between = None
        if touch is not None and len(touch.strength):
            bed, below, shares = bed.touched(touch.places, touch.strength / exchange.law.coefficient, touch.side.mean())
            between = conductances((touch.vertices, touch.hats), (below, shares), touch.strength)
        network = bed.capacity(exchange.effusivity, dt), np.empty((0, 2), int), np.empty(0)
        start = exchange.law.temperature + bed.rise(exchange.effusivity, dt)
        self._beds[name] = self._append(name, network, start, between, rubbed), bed

    def _append(self, name: str, network, temperature: np.ndarray, between, rubbed) -> int:
        """Nodes behind those that are there, coupled with the workpiece by pairs and conductances; the first of them."""
        first, given = sum(map(len, self._starts)), np.zeros(len(temperature))
        capacity, pairs, conductance = network
        if between is not None:
            ends, strength = between
            whole = np.bincount(ends[:, 0], strength, len(rubbed))
            share = strength * np.divide(rubbed, whole, out=np.zeros_like(whole), where=whole > 0)[ends[:, 0]]
            given += np.bincount(ends[:, 1], share, len(given))
            self._couplings[name] = ends + [0, first], strength
        self._parts.append((capacity, pairs + first, conductance))
        self._starts.append(temperature)
        self._given.append(given)
        return first

    def step(self, dt: float):
        """Temperatures and losses of the workpiece, temperatures of the tools and what waits in them, their columns, heat
        that went through contacts of workpieces, imbalance and cut pairs."""
        capacities, pairs, conductances_ = zip(*self._parts, strict=True)
        coupled = [*self._couplings.values(), *(meeting[:2] for meeting in self._meetings.values())]
        start, n = np.concatenate(self._starts), len(self._starts[0])
        padded = lambda values: np.concatenate([values, np.zeros(len(start) - n)])  # noqa: E731
        capacity = np.concatenate(capacities)
        network = Network(
            capacity, np.concatenate([*pairs, *(p for p, _ in coupled)]),
            np.concatenate([*conductances_, *(g for _, g in coupled)]),
            {name: Surroundings(padded(b), padded(ambient)) for name, (b, ambient) in self._outside.items()},
            {name: Radiation(padded(area), padded(ambient)) for name, (area, ambient) in self._radiation.items()})
        found = network.step(start, np.concatenate(self._given), dt)
        after = found.temperature
        lost = {name: values[:n] for name, values in found.lost.items()}
        flow = lambda between, strength: dt * strength * (after[between[:, 0]] - after[between[:, 1]])  # noqa: E731
        for name, (between, strength) in self._couplings.items():
            lost[name] = np.bincount(between[:, 0], flow(between, strength), n)
        through = {name: outwards * float(flow(between, strength).sum())
                   for name, (between, strength, outwards) in self._meetings.items()}
        ends = {first: first + len(part) for part, first in
               zip(self._starts, np.cumsum([0, *map(len, self._starts[:-1])]), strict=True) if len(part)}
        tools, waiting = {}, {}
        for name, (first, waits) in self._meshes.items():
            tools[name], waiting[name] = after[first: ends[first]], Waiting.none(ends[first] - first)
            if waits is not None:
                base, stores, step = waits
                tools[name], waiting[name] = base, replace(step, held=stores * (tools[name] - base))
        taken = capacity * (after - start)
        beds = {name: bed.advanced(taken[first: first + len(bed.area)], dt) for name, (first, bed) in self._beds.items()}
        return after[:n], lost, tools, waiting, beds, through, (found.imbalance, found.cut_pairs)
