"""Heat of a workpiece and its tools from one time to the next.

The flow of a step says how much heat was made (gathered by the time schemes, node by node, as the strain is); then one
implicit step of conduction and exchange takes the nodes to their new temperatures where they lie at its end.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from ..laws.heat_exchange import Air, HeatExchange, NoExchange
from ..physics.thermal import columns
from ..physics.thermal.field import HeatField
from ..physics.thermal.network import Network, Radiation, Surroundings
from ..physics.thermal.sources import PlasticHeat, friction_heat

CLOSED = 1e-2            # of the size of a contact facet: how near to a tool a point of the surface touches it
PLASTIC, FRICTION = "plastic", "friction"
COLUMN, RATE = "heat.column.", "heat.rate."      # names in which columns and rates are carried along with the history
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


@dataclass(frozen=True)
class HeatState:
    """What the next step of heat needs to know, and what the last one moved.

    columns : tool → (nodes, modes) of the columns below the nodes · tools : tool → temperatures of its mesh, degC
    drift : (nodes,) K/s, of the last step: change of temperature by conduction and exchange, without what was made
    made, lost : heat of the last step by source, and by where it went, mJ · imbalance : of it, relative
    cut_pairs : how many were left out in it (``Network.step``)
    """

    columns: dict[str, np.ndarray] = field(default_factory=dict)
    tools: dict[str, np.ndarray] = field(default_factory=dict)
    drift: np.ndarray | None = None
    made: dict[str, float] = field(default_factory=dict)
    lost: dict[str, float] = field(default_factory=dict)
    imbalance: float = 0.0
    cut_pairs: int = 0


class BodyHeat:
    """The heat problem of one workpiece.

    Parameters
    ----------
    heat_field : of the workpiece, on its present mesh
    facets : its surface without mirror planes (``ContactFacets``)
    exchanges : tool → what it does with heat; the others take none
    effusivity : of the workpiece
    air : what surrounds the free surface, or None
    workpiece, plastic_fraction : whose flow makes heat; None where nothing flows, or its work does not heat
    """

    def __init__(self, heat_field: HeatField, facets, *, exchanges: dict[str, ToolExchange],
                 effusivity: float, air: Air | None = None, workpiece=None, plastic_fraction: float | None = None):
        self.field, self.facets, self.air = heat_field, facets, air
        self.exchanges, self.effusivity = exchanges, effusivity
        self._plastic = PlasticHeat(workpiece, heat_field, plastic_fraction) if plastic_fraction else None
        self._contact = None if workpiece is None else workpiece.contact
        self.seconds = 0.0

    # ------------------------------------------------------------------ while the body flows
    def _names(self) -> list[str]:
        rubbed = [] if self._contact is None else [t.name for t in self._contact.tools if t.has_friction]
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
        return HeatState(columns={name: columns.at_rest(count) for name in below}, drift=np.zeros(count),
                         made=dict.fromkeys(self._names(), 0.0),
                         lost=dict.fromkeys([*self.exchanges, *self._air_parts()], 0.0))

    # ------------------------------------------------------------------ from mesh to mesh, from run to run
    def packed(self, state: HeatState) -> dict[str, np.ndarray]:
        """What of the state lives on the nodes, (nodes[, k]), by name: to be carried along with the history."""
        return {"heat.drift": state.drift} | {f"{COLUMN}{name}": modes for name, modes in state.columns.items()}

    def unpacked(self, packed: dict[str, np.ndarray], state: HeatState) -> tuple[dict[str, np.ndarray], HeatState]:
        """The history without the names of :meth:`packed`, and the state with what they held."""
        history = {name: values for name, values in packed.items() if not name.startswith("heat.")}
        below = {name: packed[f"{COLUMN}{name}"] for name in state.columns}
        return history, replace(state, drift=packed["heat.drift"], columns=below)

    def spread(self, packed: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The same with the columns of the surface also at the nodes inside, which are nearest to them: so that those of a
        new surface, which lies a little off the old one, are found between columns and not half-way to none. Collective."""
        return packed | {name: self.field.from_surface(self.facets, values) for name, values in packed.items()
                         if name.startswith(COLUMN)}

    def saved(self, state: HeatState, rates: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Nodal arrays (nodes[, k]) from which a run goes on, by name; ``rates`` of the present flow."""
        now = {f"{RATE}{name}": rates[name] for name in [*self._names(), "temperature"]}
        return self.packed(state) | now | {"heat.capacity": self.field.capacity}

    def resumed(self, nodal: dict[str, np.ndarray]) -> tuple[HeatState, dict[str, np.ndarray]]:
        """The state and the rates that :meth:`saved` took, with the capacities of then."""
        self.field.capacity = nodal["heat.capacity"]
        rates = {name.removeprefix(RATE): values for name, values in nodal.items() if name.startswith(RATE)}
        return self.unpacked(nodal, self.first())[1], rates

    def continues(self, other: BodyHeat, before: dict[str, np.ndarray], history: dict[str, np.ndarray]
                  ) -> tuple[dict[str, np.ndarray], float]:
        """Go on from the heat problem of another mesh: the same mass, and the same heat. The history, its temperatures
        corrected within their own bounds, and the relative change of the heat that is left. Collective.

        before, history : with the temperatures on the other mesh and on this one
        """
        self.field.keep_mass_of(other.field)
        content = other.field.content(before["temperature"])
        corrected = self.field.with_content(history["temperature"], content)
        self.seconds = other.seconds
        return history | {"temperature": corrected}, self.field.content(corrected) / content - 1.0

    def _air_parts(self) -> list[str]:
        air = self.air
        return [] if air is None else ["air"] * bool(air.coefficient) + ["radiation"] * bool(air.emissivity)

    def advance(self, before: dict[str, np.ndarray], gathered: dict[str, np.ndarray], state: HeatState, tools,
                dt: float) -> tuple[dict[str, np.ndarray], HeatState]:
        """History and state after a step of ``dt``, s, with body and tools where they are. Collective.

        before : history at the start of the step · gathered : the same at its end, with the heat that was made (nodes,), K
        tools : the ``KnownTool`` s, where they are at the end of the step
        """
        begun, temperature = perf_counter(), before["temperature"]
        made = {name: values for name, values in gathered.items() if name not in before}
        touched, free = self._touched(tools)
        warmed = self.warming(made)
        rubbed = {name: self._to_tool(name, made, touched[name], dt) for name in touched}
        outside = {name: self._surroundings(name, area, state, rubbed[name], dt) for name, area in touched.items()}
        radiation = {}
        if "air" in self._air_parts():
            outside["air"] = Surroundings(self.air.coefficient * free, self.air.temperature)
        if "radiation" in self._air_parts():
            radiation["radiation"] = Radiation(self.air.emissivity * free, self.air.temperature)
        after, lost, imbalance, cut = self._solved(temperature, warmed * self.field.capacity, outside, radiation, dt)
        memory = {name: self._column_after(name, modes, touched.get(name), lost.get(name), rubbed.get(name), dt)
                  for name, modes in state.columns.items()}
        history = {name: gathered[name] for name in before} | {"temperature": after}
        self.seconds += perf_counter() - begun
        total, capacity = self.field.total, self.field.capacity
        return history, replace(
            state, columns=memory, drift=(after - temperature - warmed) / dt, imbalance=imbalance, cut_pairs=cut,
            made={name: total(self._kept(name) * values * capacity) for name, values in made.items()},
            lost={name: total(values) for name, values in lost.items()})

    def parts_built(self) -> list[str]:
        """What the problem consists of, as words."""
        tools = [f"heat exchange {name}: {exchange.law.kind}" for name, exchange in self.exchanges.items()]
        return ["heat conduction", *(f"heat by {name}" for name in self._names()), *tools,
                *(f"heat to {name}" for name in self._air_parts())]

    # ------------------------------------------------------------------ the surface
    def _touched(self, tools) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Surface of the nodes that lies on every tool that takes heat, and that which lies on none, (nodes,), mm²."""
        facets = self.facets
        points, weights = facets.trace(self.field.nodes.x), facets.weights()
        reach, nearest = CLOSED * facets.size(), np.full(len(weights), -1)
        least = np.full(len(weights), np.inf)
        for k, tool in enumerate(tools):
            gap, _ = tool.gap(points)
            nearer = (gap <= reach) & (gap < least)
            nearest[nearer], least[nearer] = k, gap[nearer]
        share = lambda mine: self.field.surface_sum(facets, weights * mine)  # noqa: E731
        return {tool.name: share(nearest == k) for k, tool in enumerate(tools) if self._exchange(tool.name).law.acts}, \
            share(nearest < 0)

    def _to_tool(self, name: str, made: dict, area: np.ndarray, dt: float) -> np.ndarray:
        """Friction heat that a tool gets where it is touched, (nodes,), mJ/s/mm²."""
        source = f"{FRICTION}.{name}"
        if source not in made:
            return np.zeros_like(area)
        power = (1 - self._kept(source)) * made[source] * self.field.capacity / dt
        return np.divide(power, area, out=np.zeros_like(area), where=area > 0)

    def _surroundings(self, name: str, area: np.ndarray, state: HeatState, rubbed: np.ndarray, dt: float) -> Surroundings:
        """A tool as the nodes feel it in the step.

        A column answers a flux q at once with a rise R q of its surface, so it is felt through 1/h + R, in front of the
        temperature that its surface would have without q.
        """
        exchange = self.exchanges[name]
        law = exchange.law
        if law.kind == "constant":
            return Surroundings(law.coefficient * area, law.temperature)
        answer = columns.resistance(dt) / exchange.effusivity
        by_itself = law.temperature + columns.rise(state.columns[name], dt) / exchange.effusivity + answer * rubbed
        return Surroundings(area / (1 / law.coefficient + answer), by_itself)

    def _column_after(self, name: str, modes, area, lost, rubbed, dt: float) -> np.ndarray:
        """The columns below the nodes after the step, with what they were given; they rest where they are not touched."""
        if area is None:
            return columns.advanced(modes, np.zeros(len(modes)), dt)
        flux = np.divide(lost, dt * area, out=np.zeros_like(area), where=area > 0) + rubbed
        return columns.advanced(modes, flux, dt)

    # ------------------------------------------------------------------ the solve, on rank 0
    def _solved(self, temperature, heat, outside: dict[str, Surroundings], radiation: dict[str, Radiation], dt: float):
        """Temperatures (nodes,), heat lost by the nodes (nodes,) mJ by name, imbalance and cut pairs. Collective."""
        gathered, comm = self.field.gathered, self.field.nodes.comm
        network, start, given = self.field.network(), gathered(temperature), gathered(heat)
        outside = {name: (gathered(s.conductance), gathered(np.broadcast_to(s.ambient, len(temperature))))
                   for name, s in outside.items()}
        radiation = {name: (gathered(r.area), r.ambient) for name, r in radiation.items()}
        answer = None
        if network is not None:
            found = Network(*network, {n: Surroundings(*s) for n, s in outside.items()},
                            {n: Radiation(*r) for n, r in radiation.items()}).step(start, given, dt)
            answer = found.imbalance, found.cut_pairs, found.temperature, found.lost
        imbalance, cut, after, lost = comm.bcast(answer, 0)
        scattered = self.field.scattered
        return scattered(after), {name: scattered(values) for name, values in lost.items()}, imbalance, cut


INSULATING = ToolExchange(NoExchange())
