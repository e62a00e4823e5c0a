"""Heat of a workpiece and its tools from one time to the next.

The flow of a step says how much heat was made (gathered by the time schemes, node by node, as the strain is); then one
implicit step of conduction and exchange takes the nodes to their new temperatures where they lie at its end.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from ...laws.heat_exchange import Air
from ...physics.thermal.bed import Bed
from ...physics.thermal.field import HeatField
from ...physics.thermal.sources import PlasticHeat, friction_heat
from .meeting import Meeting, friction_heat_between
from .surface import INSULATING, Surface, ToolExchange
from .tool_field import ToolHeat, Waiting

PLASTIC, FRICTION = "plastic", "friction"
RATE = "heat.rate."      # name in which rates are saved


@dataclass(frozen=True)
class HeatState:
    """What the next step of heat needs to know, and what the last one moved.

    columns : tool → the columns below its surface · tools : tool → temperatures of its vertices, degC
    waited : tool → where it is in its own step
    drift : (nodes,) K/s, of the last step: change of temperature by conduction and exchange, without what was made
    hottest : tool with a temperature of its own → that of its hottest place, degC
    made, lost : heat of the last step by source, and by where it went, mJ · imbalance : of it, relative
    through : contact of two workpieces → heat that the first has given the other in it, mJ
    cut_pairs : how many were left out in it (``Network.step``)
    """

    columns: dict[str, Bed] = field(default_factory=dict)
    tools: dict[str, np.ndarray] = field(default_factory=dict)
    waited: dict[str, Waiting] = field(default_factory=dict)
    hottest: dict[str, float] = field(default_factory=dict)
    drift: np.ndarray | None = None
    made: dict[str, float] = field(default_factory=dict)
    lost: dict[str, float] = field(default_factory=dict)
    through: dict[str, float] = field(default_factory=dict)
    imbalance: float = 0.0
    cut_pairs: int = 0


class BodyHeat:
    """The heat problem of a workpiece, or of several in one mesh.

    Parameters
    ----------
    heat_field : of the workpiece, on its present mesh
    facets : its surface without mirror planes (``ContactFacets``)
    exchanges : tool → what it does with heat; the others take none
    effusivity : of the workpiece, of several (nodes,)
    tool_heats : of those among them that have a mesh
    air : what surrounds the free surface, or None; of several ``building.AirOfBodies``
    parts, meetings : of several workpieces, and where they may touch
    workpiece, plastic_fraction : whose flow makes heat; None where nothing flows, or its work does not heat
    """

    def __init__(self, heat_field: HeatField, facets, *, exchanges: dict[str, ToolExchange],
                 effusivity: float | np.ndarray, air: Air | None = None, tool_heats: dict[str, ToolHeat] | None = None,
                 workpiece=None, plastic_fraction: float | np.ndarray | None = None, parts=None,
                 meetings: tuple[Meeting, ...] = ()):
        self.field, self.facets, self.air, self.tool_heats = heat_field, facets, air, tool_heats or {}
        self.exchanges, self.effusivity = exchanges, effusivity
        self.parts, self.meetings = parts, meetings
        self._plastic = None if plastic_fraction is None else PlasticHeat(workpiece, heat_field, plastic_fraction)
        self._contact = None if workpiece is None else workpiece.contact
        self._interfaces, self._workpiece = getattr(workpiece, "interfaces", None), workpiece
        self.seconds = 0.0

    # ------------------------------------------------------------------ while the body flows
    def _names(self) -> list[str]:
        rubbed = [] if self._contact is None else [t.name for t in self._contact.tools if t.has_friction]
        rubbed += [] if self._interfaces is None else [n for n, c in self._interfaces.by_name.items() if c.has_friction]
        return [PLASTIC] * (self._plastic is not None) + [f"{FRICTION}.{name}" for name in rubbed]

    def gathering(self) -> dict[str, np.ndarray]:
        """Places for what a step gathers, by source: heating of the nodes (nodes,), K, nothing yet."""
        return {name: np.zeros(self.field.nodes.count) for name in self._names()}

    def rates(self) -> dict[str, np.ndarray]:
        """Rates of the same in the present flow, (nodes,), K/s. Collective."""
        start = perf_counter()
        rates = {} if self._plastic is None else {PLASTIC: self._plastic.rate()}
        if self._contact is not None:
            rates |= {f"{FRICTION}.{name}": rate for name, rate in friction_heat(self.field, self._contact).items()}
        if self._interfaces is not None:
            powers, by_name = self._interfaces.friction_powers(self._workpiece.velocity), self._interfaces.by_name
            rates |= {f"{FRICTION}.{m.name}": friction_heat_between(self.field, m, by_name[m.name], powers[m.name])
                      for m in self.meetings if m.name in powers}
        self.seconds += perf_counter() - start
        return rates

    def warming(self, rates: dict[str, np.ndarray]) -> np.ndarray:
        """Heating of the nodes by what stays in the workpiece of the heat that is made, (nodes,), K/s."""
        return sum((self._kept(name) * rate for name, rate in rates.items()), np.zeros(self.field.nodes.count))

    def _kept(self, source: str) -> float:
        """Share of a source that stays in the workpiece."""
        return 1.0 if source == PLASTIC else self._exchange(source.removeprefix(f"{FRICTION}.")).share(self.effusivity)

    def _exchange(self, tool: str) -> ToolExchange:
        return self.exchanges.get(tool, INSULATING)

    # ------------------------------------------------------------------ a step
    def first(self) -> HeatState:
        """The state at the start: the tools have got no heat yet."""
        below = [name for name, exchange in self.exchanges.items() if exchange.law.kind == "column"]
        count = self.field.nodes.count
        return HeatState(columns={name: Bed.untouched(self.field.nodes.dim) for name in below}, drift=np.zeros(count),
                         tools={name: tool.first() for name, tool in self.tool_heats.items()},
                         waited={name: Waiting.none(tool.count) for name, tool in self.tool_heats.items()},
                         hottest={name: self.exchanges[name].law.temperature for name in [*below, *self.tool_heats]},
                         made=dict.fromkeys(self._names(), 0.0),
                         lost=dict.fromkeys([*self.exchanges, *self.air_parts()], 0.0),
                         through={m.name: 0.0 for m in self.meetings if m.coefficient is not None})

    # ------------------------------------------------------------------ from mesh to mesh, from run to run
    def packed(self, state: HeatState) -> dict[str, np.ndarray]:
        """What of the state lives on the nodes, (nodes[, k]), by name: to be carried along with the history."""
        return {"heat.drift": state.drift}

    def unpacked(self, packed: dict[str, np.ndarray], state: HeatState) -> tuple[dict[str, np.ndarray], HeatState]:
        """The history without the names of :meth:`packed`, and the state with what they held."""
        history = {name: values for name, values in packed.items() if not name.startswith("heat.")}
        return history, replace(state, drift=packed["heat.drift"])

    def saved(self, state: HeatState, rates: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Nodal arrays (nodes[, k]) from which a run goes on, by name; ``rates`` of the present flow."""
        now = {f"{RATE}{name}": rates[name] for name in [*self._names(), "temperature"]}
        return self.packed(state) | now | {"heat.capacity": self.field.capacity}

    def tool_memory(self, state: HeatState) -> dict:
        """What of the state belongs to tools, as JSON can hold it."""
        fields = {name: {"temperature": state.tools[name], "waited": state.waited[name].memory()}
                  for name in self.tool_heats}
        return fields | {name: bed.memory() for name, bed in state.columns.items()}

    def resumed(self, nodal: dict[str, np.ndarray], tools: dict) -> tuple[HeatState, dict[str, np.ndarray]]:
        """The state and the rates that :meth:`saved` and :meth:`tool_memory` took, with the capacities of then."""
        self.field.capacity = nodal["heat.capacity"]
        rates = {name.removeprefix(RATE): values for name, values in nodal.items() if name.startswith(RATE)}
        first = self.first()
        start = replace(first, tools={name: np.array(tools[name]["temperature"]) for name in first.tools},
                        waited={name: Waiting(steps, time, np.array(held)) for name in first.tools
                                for steps, time, held in [tools[name]["waited"]]},
                        columns={name: Bed.remembered(tools[name], self.field.nodes.dim) for name in first.columns})
        return self.unpacked(nodal, start)[1], rates

    def continues(self, other: BodyHeat, before: dict[str, np.ndarray], history: dict[str, np.ndarray]
                  ) -> tuple[dict[str, np.ndarray], float]:
        """Go on from the heat problem of another mesh: the same mass, and the same heat, of every body. The history, its
        temperatures corrected within their own bounds, and the relative change of the heat that is left. Collective.

        before, history : with the temperatures on the other mesh and on this one
        """
        content, corrected = other.field.content(before["temperature"]), history["temperature"]
        for k in range(1 if self.parts is None else len(self.parts.names)):
            theirs, mine = (True if heat.parts is None else heat.parts.of_node == k for heat in (other, self))
            self.field.keep_mass_of(other.field, theirs, mine)
            own = other.field.content(np.where(theirs, before["temperature"], 0.0))
            corrected = self.field.with_content(corrected, own, mine)
        self.seconds = other.seconds
        return history | {"temperature": corrected}, self.field.content(corrected) / content - 1.0

    def air_parts(self) -> list[str]:
        """How the free surface loses heat, by the names of that in the balance."""
        air = self.air
        return [] if air is None else air.ways

    def advance(self, before: dict[str, np.ndarray], gathered: dict[str, np.ndarray], state: HeatState, tools,
                dt: float) -> tuple[dict[str, np.ndarray], HeatState]:
        """History and state after a step of ``dt``, s, with body and tools where they are. Collective.

        before : history at the start of the step · gathered : the same at its end, with the heat that was made (nodes,), K
        tools : the ``KnownTool`` s, where they are at the end of the step
        """
        begun, capacity = perf_counter(), self.field.capacity
        temperature, made = before["temperature"], {name: v for name, v in gathered.items() if name not in before}
        warmed = self.warming(made)
        surface = Surface(self, tools)
        rubbed = {name: (1 - self._kept(f"{FRICTION}.{name}")) * made[f"{FRICTION}.{name}"] * capacity
                  for name in self.exchanges if f"{FRICTION}.{name}" in made}
        found = surface.step(temperature, warmed * capacity, rubbed, state, dt)
        history = {name: gathered[name] for name in before} | {"temperature": found.temperature}
        self.seconds += perf_counter() - begun
        total = self.field.total
        return history, replace(
            state, columns=found.columns, tools=found.tools, waited=found.waited,
            hottest=self._hottest(found), through=found.through, imbalance=found.imbalance, cut_pairs=found.cut_pairs,
            drift=(found.temperature - temperature - warmed) / dt,
            made={name: total(self._kept(name) * values * capacity) for name, values in made.items()},
            lost={name: total(values) for name, values in found.lost.items()})

    def _hottest(self, found) -> dict[str, float]:
        """The hottest place of every tool with a temperature of its own, degC."""
        hottest = {name: float(temperatures.max()) for name, temperatures in found.tools.items()}
        for name, bed in found.columns.items():
            exchange = self.exchanges[name]
            hottest[name] = exchange.law.temperature + float(bed.rise(exchange.effusivity, 0.0).max(initial=0.0))
        return hottest

    def parts_built(self) -> list[str]:
        """What the problem consists of, as words."""
        tools = [f"heat exchange {name}: {exchange.law.kind}" for name, exchange in self.exchanges.items()]
        between = [f"heat through {m.name}" for m in self.meetings if m.coefficient is not None]
        return ["heat conduction", *(f"heat by {name}" for name in self._names()), *tools, *between,
                *(f"heat to {name}" for name in self.air_parts())]
