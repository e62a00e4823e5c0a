"""What a workpiece exchanges over its surface in one step of heat: with tools of every kind, and with the air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..laws.heat_exchange import HeatExchange, NoExchange
from ..physics.thermal import columns
from ..physics.thermal.network import Network, Radiation, Surroundings
from ..physics.thermal.pairing import dense_points
from .tool_heat import ToolHeat, Touch

CLOSED = 1e-2            # of the size of its facet: how near to a tool a point of the surface touches it
FACING = 0.7             # cosine between the normals of both; a side that meets a tool with its edge does not lie on it
MOST_PARTS = {2: 32, 3: 6}    # of a side, where the tool below has finer ones
SHARE_UNKNOWN = 0.5      # of the friction heat, for the workpiece, where the tool's material is not known


@dataclass(frozen=True)
class ToolExchange:
    """What a tool does with heat: its law, and the effusivity of its material where it is known, mJ/(mm² K s^½)."""

    law: HeatExchange
    effusivity: float | None = None

    def share(self, effusivity: float) -> float:
        """Of the friction heat, for a workpiece of this effusivity: as two half spaces that stay equally hot share it."""
        if not self.law.acts:
            return 1.0
        return SHARE_UNKNOWN if self.effusivity is None else effusivity / (effusivity + self.effusivity)


INSULATING = ToolExchange(NoExchange())


@dataclass(frozen=True)
class HeatStep:
    """What a step found: temperatures (nodes,) degC, heat lost by the nodes (nodes,) mJ by name, and what comes after it of
    the columns and of the tools (see ``heating.HeatState``)."""

    temperature: np.ndarray
    lost: dict[str, np.ndarray]
    columns: dict[str, np.ndarray]
    tools: dict[str, np.ndarray]
    waited: dict[str, tuple[int, float]]
    imbalance: float
    cut_pairs: int


class Surface:
    """The surface of a workpiece between its tools, as both lie now. Making one is collective.

    Attributes
    ----------
    touched : tool that takes heat → surface of the nodes that lies on it, (nodes,) mm² · free : surface on no tool
    """

    def __init__(self, heat, tools):
        self.heat, self.field = heat, heat.field
        facets = heat.facets
        self._sides = _Sides(self.field.nodes.x[facets.facet_nodes])
        points, weights = facets.trace(self.field.nodes.x), facets.weights()
        points = points.reshape(len(facets.facet_nodes), -1, facets.dim)
        nearest, least = np.full(len(weights), -1), np.full(len(weights), np.inf)
        for k, tool in enumerate(tools):
            gap = self._sides.gap(tool, points).ravel()
            nearer = gap < least
            nearest[nearer], least[nearer] = k, gap[nearer]
        area = lambda mine: self.field.surface_sum(facets, weights * mine)  # noqa: E731
        self.free = area(nearest < 0)
        self.touched = {tool.name: area(nearest == k) for k, tool in enumerate(tools) if tool.name in heat.exchanges}
        self._touch = {tool.name: self._points(tool) for tool in tools if tool.name in heat.tool_heats}

    def _points(self, tool) -> Touch:
        """Points that touch a tool with a mesh, so dense that none of its sides goes without."""
        facets, nodes, law = self.heat.facets, self.field.nodes, self.heat.exchanges[tool.name].law
        parts = int(np.clip(np.ceil(2 * facets.size() / self.heat.tool_heats[tool.name].finest), 2, MOST_PARTS[nodes.dim]))
        places, area, hats = dense_points(nodes.x[facets.facet_nodes], parts)
        mine = self._sides.gap(tool, places) < np.inf
        facet, point = np.nonzero(mine)
        weight = np.broadcast_to(self.field.kinematics.weight_at(places[mine]), len(facet))
        corners = self.field.vertex_numbers[facets.facet_nodes[:, : nodes.dim]]
        return Touch(tool.motion.to_tool(places[mine]), law.coefficient * area[mine] * weight, corners[facet], hats[point])

    def step(self, temperature: np.ndarray, heat: np.ndarray, rubbed: dict[str, np.ndarray], state, dt: float) -> HeatStep:
        """A step of ``dt``, s, in which the nodes are given ``heat`` (nodes,) mJ, and the tools ``rubbed`` (nodes,) mJ
        where the nodes touch them. Collective."""
        outside, radiation = self._air()
        flux = {name: np.divide(rubbed.get(name, 0.0), dt * area, out=np.zeros_like(area), where=area > 0)
                for name, area in self.touched.items() if name not in self._touch}
        outside |= {name: self._surroundings(name, flux[name], state, dt) for name in flux}
        after, lost, tools, waited, balance = self._solved(temperature, heat, outside, radiation, rubbed, state, dt)
        memory = {name: self._column_after(name, modes, lost, flux, dt) for name, modes in state.columns.items()}
        return HeatStep(after, lost, memory, tools, waited, *balance)

    def _air(self) -> tuple[dict[str, Surroundings], dict[str, Radiation]]:
        air, parts = self.heat.air, self.heat.air_parts()
        outside = {"air": Surroundings(air.coefficient * self.free, air.temperature)} if "air" in parts else {}
        grey = {"radiation": Radiation(air.emissivity * self.free, air.temperature)} if "radiation" in parts else {}
        return outside, grey

    # ------------------------------------------------------------------ tools without a mesh
    def _surroundings(self, name: str, rubbed: np.ndarray, state, dt: float) -> Surroundings:
        """A tool as the nodes feel it in the step; ``rubbed`` (nodes,) mW/mm² is friction heat that it gets besides.

        A column answers a flux q at once with a rise R q of its surface, so it is felt through 1/h + R, in front of the
        temperature that its surface would have without q.
        """
        exchange, area = self.heat.exchanges[name], self.touched[name]
        law = exchange.law
        if law.kind == "constant":
            return Surroundings(law.coefficient * area, law.temperature)
        answer = columns.resistance(dt) / exchange.effusivity
        by_itself = law.temperature + columns.rise(state.columns[name], dt) / exchange.effusivity + answer * rubbed
        return Surroundings(area / (1 / law.coefficient + answer), by_itself)

    def _column_after(self, name: str, modes, lost, rubbed, dt: float) -> np.ndarray:
        """The columns below the nodes after the step, with what they were given; they rest where they are not touched."""
        if name not in self.touched:
            return columns.advanced(modes, np.zeros(len(modes)), dt)
        area = self.touched[name]
        flux = np.divide(lost[name], dt * area, out=np.zeros_like(area), where=area > 0) + rubbed[name]
        return columns.advanced(modes, flux, dt)

    # ------------------------------------------------------------------ the solve, on rank 0
    def _solved(self, temperature, heat, outside, radiation, rubbed, state, dt: float):
        """Temperatures (nodes,), heat lost by the nodes (nodes,) by name, what follows of the tools, balance. Collective.

        Everything is solved on rank 0: there are a twentieth as many temperatures as velocities.
        """
        gathered, comm, count = self.field.gathered, self.field.nodes.comm, len(temperature)
        parts = self.field.network(), gathered(temperature), gathered(heat)
        outside = {name: (gathered(s.conductance), gathered(np.broadcast_to(s.ambient, count)))
                   for name, s in outside.items()}
        radiation = {name: (gathered(r.area), r.ambient) for name, r in radiation.items()}
        touches = {name: (touch.gathered(comm), gathered(np.broadcast_to(rubbed.get(name, 0.0), count)))
                   for name, touch in self._touch.items()}
        waited = {name: due(tool, state.waited[name], dt) for name, tool in self.heat.tool_heats.items()}
        answer = None
        if comm.rank == 0:
            joint = Joint(*parts, outside, radiation)
            for name, tool in self.heat.tool_heats.items():
                joint.add(name, tool, state.tools[name], *touches.get(name, (None, None)), waited[name][1] / dt)
            answer = joint.step(dt)
        after, lost, tools, balance = comm.bcast(answer, 0)
        scattered = self.field.scattered
        left = {name: (steps, state.waited[name][1] + dt) if time == 0 else (0, 0.0)
                for name, (steps, time) in waited.items()}
        return scattered(after), {name: scattered(values) for name, values in lost.items()}, tools, left, balance


class _Sides:
    """Sides of the surface (f, 3 | 6, dim), to ask which of their points lie on a tool."""

    def __init__(self, x: np.ndarray):
        dim = x.shape[2]
        edges = x[:, 1:dim] - x[:, :1]
        across = edges[:, 0, ::-1] * [1.0, -1.0] if dim == 2 else np.cross(edges[:, 0], edges[:, 1])
        self._across = across / np.linalg.norm(across, axis=1, keepdims=True)
        self._reach = CLOSED * np.linalg.norm(edges[:, 0], axis=1)

    def gap(self, tool, points: np.ndarray) -> np.ndarray:
        """Distances (f, q) of points (f, q, dim) of the sides from a tool, mm; inf where they do not lie on it."""
        gap, normal = tool.gap(points.reshape(-1, points.shape[2]))
        gap = gap.reshape(points.shape[:2])
        facing = np.abs(np.einsum("fqd,fd->fq", normal.reshape(points.shape), self._across)) > FACING
        return np.where((gap <= self._reach[:, None]) & facing, gap, np.inf)


def due(tool: ToolHeat, waited: tuple[int, float], dt: float) -> tuple[int, float]:
    """Steps since heat was conducted inside a tool, this one included, and for how long it is conducted in this one, s: not
    at all until its own step is over."""
    steps, time = waited[0] + 1, waited[1] + dt
    return steps, time if steps >= tool.law.every else 0.0


class Joint:
    """The vertices of a workpiece and of the tools that have a mesh, as one network; on rank 0.

    Parameters
    ----------
    network : capacities, pairs and conductances of the workpiece · start : its temperatures · given : heat, mJ
    outside, radiation : by name, conductance or area, and temperature there
    """

    def __init__(self, network, start, given, outside, radiation):
        self._parts, self._starts, self._given = [network], [start], [given]
        self._outside, self._radiation = outside, radiation
        self._first = {"": 0}
        self._couplings: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    def add(self, name: str, tool: ToolHeat, temperature: np.ndarray, touch: Touch | None, rubbed, conducting: float):
        """A tool, its vertices behind those that are there; ``rubbed`` (v,) mJ, friction heat that it gets where vertices
        of the workpiece touch it. Inside it conducts ``conducting`` times as long as the step lasts."""
        first = sum(len(start) for start in self._starts)
        capacity, pairs, conductance = tool.network
        self._parts.append((capacity, pairs + first, conducting * conductance))
        self._starts.append(temperature)
        given = np.zeros(tool.count)
        if touch is not None:
            pairs, strength = tool.pairs(touch)
            whole = np.bincount(pairs[:, 0], strength, len(rubbed))
            share = strength * np.divide(rubbed, whole, out=np.zeros_like(whole), where=whole > 0)[pairs[:, 0]]
            given += np.bincount(pairs[:, 1], share, tool.count)
            self._couplings[name] = pairs + [0, first], strength
        self._given.append(given)
        self._first[name] = first

    def step(self, dt: float):
        """Temperatures and losses of the workpiece, temperatures of the tools, imbalance and cut pairs."""
        capacities, pairs, conductances = zip(*self._parts, strict=True)
        coupled = list(self._couplings.values())
        start, n = np.concatenate(self._starts), len(self._starts[0])
        padded = lambda values: np.concatenate([values, np.zeros(len(start) - n)])  # noqa: E731
        network = Network(
            np.concatenate(capacities), np.concatenate([*pairs, *(p for p, _ in coupled)]),
            np.concatenate([*conductances, *(g for _, g in coupled)]),
            {name: Surroundings(padded(b), padded(ambient)) for name, (b, ambient) in self._outside.items()},
            {name: Radiation(padded(area), ambient) for name, (area, ambient) in self._radiation.items()})
        found = network.step(start, np.concatenate(self._given), dt)
        after = found.temperature
        lost = {name: values[:n] for name, values in found.lost.items()}
        for name, (between, strength) in self._couplings.items():
            flow = dt * strength * (after[between[:, 0]] - after[between[:, 1]])
            lost[name] = np.bincount(between[:, 0], flow, n)
        names = [name for name in self._first if name]
        ends = [*(self._first[name] for name in names), len(start)]
        tools = {name: after[ends[k]: ends[k + 1]] for k, name in enumerate(names)}
        return after[:n], lost, tools, (found.imbalance, found.cut_pairs)
