"""What a workpiece exchanges over its surface in one step of heat: with tools of every kind, and with the air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...laws.heat_exchange import HeatExchange, NoExchange
from ...physics.facets import mean_lengths
from ...physics.thermal.bed import Bed
from ...physics.thermal.network import Radiation, Surroundings
from ...physics.thermal.pairing import dense_points, normals_of
from .joint import Joint
from .meeting import Opposite, joined
from .tool_field import Touch, Waiting

CLOSED = 1e-2            # of the size of its facet: how near to a tool a point of the surface touches it
FACING = 0.7             # cosine between the normals of both; a side that meets a tool with its edge does not lie on it
MOST_PARTS = {2: 32, 3: 6}    # of a side, where the tool below has finer ones
COLUMN_PARTS = {2: 8, 3: 4}   # of a side on columns, which stand half a side apart
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
    columns: dict[str, Bed]
    tools: dict[str, np.ndarray]
    waited: dict[str, Waiting]
    through: dict[str, float]
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
        points = points.reshape(len(facets.facet_nodes), facets.points_per_facet, facets.dim)
        nearest, least = np.full(len(weights), -1), np.full(len(weights), np.inf)
        for k, tool in enumerate(tools):
            gap = self._sides.gap(tool, points).ravel()
            nearer = gap < least
            nearest[nearer], least[nearer] = k, gap[nearer]
        area = lambda mine: self.field.surface_sum(facets, weights * mine)  # noqa: E731
        self._meetings = {m.name: (joined(self.field, m), m) for m in heat.meetings if m.coefficient is not None}
        free = nearest < 0
        if heat.meetings and heat.air_parts():
            free &= ~self._covered(points)
        self.free = area(free)
        self.touched = {tool.name: area(nearest == k) for k, tool in enumerate(tools) if tool.name in heat.exchanges}
        self._touch = {tool.name: self._points(tool) for tool in tools
                       if tool.name in heat.exchanges and heat.exchanges[tool.name].law.warms}

    def _covered(self, points: np.ndarray) -> np.ndarray:
        """Which points (f, q, dim) of the sides lie on another workpiece, (points,). Collective."""
        covered, facets = np.zeros(points.shape[:2], bool), self.heat.facets.facet_nodes
        of_side = self.heat.parts.of_node[facets[:, 0]] if len(facets) else np.zeros(0, int)
        for meeting in self.heat.meetings:
            for name, opposite in zip(meeting.bodies, (meeting.master, meeting.slave), strict=True):
                own = np.flatnonzero(of_side == self.heat.parts.names.index(name))
                normals, size = (np.repeat(values[own], points.shape[1], axis=0)
                                 for values in (self._sides.normals, self._sides.length))
                on, _, _ = Opposite(self.field, opposite).touched(points[own].reshape(-1, points.shape[2]), normals, size)
                covered[own] |= on.reshape(len(own), points.shape[1])
        return covered.ravel()

    def _points(self, tool) -> Touch:
        """Points that touch a tool that warms up, so dense that none of its sides, or columns, goes without."""
        facets, nodes, law = self.heat.facets, self.field.nodes, self.heat.exchanges[tool.name].law
        parts, mesh = COLUMN_PARTS[nodes.dim], self.heat.tool_heats.get(tool.name)
        if mesh is not None:
            parts = int(np.clip(np.ceil(2 * facets.size() / mesh.finest), 2, MOST_PARTS[nodes.dim]))
        places, area, hats = dense_points(nodes.x[facets.facet_nodes], parts)
        mine = self._sides.gap(tool, places) < np.inf
        facet, point = np.nonzero(mine)
        weight = np.broadcast_to(self.field.kinematics.weight_at(places[mine]), len(facet))
        corners = self.field.vertex_numbers[facets.facet_nodes[:, : nodes.dim]]
        return Touch(tool.motion.to_tool(places[mine]), law.coefficient * area[mine] * weight, corners[facet], hats[point],
                     self._sides.length[facet])

    def step(self, temperature: np.ndarray, heat: np.ndarray, rubbed: dict[str, np.ndarray], state, dt: float) -> HeatStep:
        """A step of ``dt``, s, in which the nodes are given ``heat`` (nodes,) mJ, and the tools ``rubbed`` (nodes,) mJ
        where the nodes touch them. Collective."""
        outside, radiation = self._air()
        for name in self.touched.keys() - self._touch.keys():
            law = self.heat.exchanges[name].law
            outside[name] = Surroundings(law.coefficient * self.touched[name], law.temperature)
        return self._solved(temperature, heat, outside, radiation, rubbed, state, dt)

    def _air(self) -> tuple[dict[str, Surroundings], dict[str, Radiation]]:
        air, parts = self.heat.air, self.heat.air_parts()
        outside = {"air": Surroundings(air.coefficient * self.free, air.temperature)} if "air" in parts else {}
        grey = {"radiation": Radiation(air.emissivity * self.free, air.temperature)} if "radiation" in parts else {}
        return outside, grey

    # ------------------------------------------------------------------ the solve, on rank 0
    def _solved(self, temperature, heat, outside, radiation, rubbed, state, dt: float):
        """The step. Collective.

        Everything is solved on rank 0: there are a twentieth as many temperatures as velocities.
        """
        gathered, comm, count = self.field.gathered, self.field.nodes.comm, len(temperature)
        nodal = lambda values: gathered(np.broadcast_to(values, count))  # noqa: E731
        parts = self.field.network(), gathered(temperature), gathered(heat)
        outside = {name: (gathered(s.conductance), nodal(s.ambient)) for name, s in outside.items()}
        radiation = {name: (gathered(r.area), nodal(r.ambient)) for name, r in radiation.items()}
        touches = {name: (touch.gathered(comm), nodal(rubbed.get(name, 0.0))) for name, touch in self._touch.items()}
        answer = None
        if comm.rank == 0:
            joint = Joint(*parts, outside, radiation)
            for name, tool in self.heat.tool_heats.items():
                joint.add(name, self.heat.exchanges[name], tool, state.tools[name], state.waited[name],
                          *touches.get(name, (None, None)), dt)
            for name, bed in state.columns.items():
                joint.add_columns(name, self.heat.exchanges[name], bed, *touches.get(name, (None, None)), dt)
            for name, (points, meeting) in self._meetings.items():
                joint.add_meeting(name, *points.pairs(meeting.coefficient), meeting.outwards)
            answer = joint.step(dt)
        after, lost, tools, waited, beds, through, balance = comm.bcast(answer, 0)
        scattered = self.field.scattered
        return HeatStep(scattered(after), {name: scattered(values) for name, values in lost.items()}, beds, tools, waited,
                        through, *balance)


class _Sides:
    """Sides of the surface (f, 3 | 6, dim), of some ``length`` (f,), mm, to ask which of their points lie on a tool."""

    def __init__(self, x: np.ndarray):
        self.normals = normals_of(x)
        self.length = mean_lengths(x[:, : x.shape[2]])

    def gap(self, tool, points: np.ndarray) -> np.ndarray:
        """Distances (f, q) of points (f, q, dim) of the sides from a tool, mm; inf where they do not lie on it."""
        gap, normal = tool.gap(points.reshape(-1, points.shape[2]))
        gap = gap.reshape(points.shape[:2])
        facing = np.abs(np.einsum("fqd,fd->fq", normal.reshape(points.shape), self.normals)) > FACING
        return np.where((gap <= CLOSED * self.length[:, None]) & facing, gap, np.inf)
