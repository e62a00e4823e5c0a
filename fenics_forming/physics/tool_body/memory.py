"""What the solver of a tool goes on from, as arrays that any number of ranks can keep and take over.

Values are at nodes (nodes, …), per owned cell (cells, …) and at the corners of the sides that hold the points of a contact;
numbers are those of all ranks.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..contact.holding import Hold
from .elastic import ElasticSolver

_NUMBERS = ("external_work", "plastic_work", "thermal_work", "reached", "cuts", "_held", "_largest_force")


@dataclass
class ToolMemory:
    """numbers · nodal, cellwise : arrays by name · between : (corners, k) of the contacts, in their order"""

    numbers: dict
    nodal: dict[str, np.ndarray]
    cellwise: dict[str, np.ndarray] = field(default_factory=dict)
    between: list[np.ndarray] = field(default_factory=list)


def memory_of(solver) -> ToolMemory:
    """The accepted state of a solver. Collective."""
    body = solver.body
    nodal = {"displacement": body.nodal(), "force": body.nodal_forces(solver.force)}
    if isinstance(solver, ElasticSolver):
        return ToolMemory({"held": body.held_part}, nodal)
    nodal["balanced"] = body.nodal_forces(solver._balanced)
    cells, cellwise = len(body.nodes.cells), dict(solver.bulk.cellwise())
    if solver._accepted_heat is not None:
        cellwise["heat"] = solver._accepted_heat
    numbers = {name: getattr(solver, name) for name in _NUMBERS} | {"held": body.held_part, "flows": solver.bulk.flows}
    contacts = getattr(solver, "contacts", ())
    numbers["fresh"] = getattr(solver, "_fresh", False)
    numbers["works"] = [contact.works().tolist() for contact in contacts]
    nodal |= {f"paired {k}": contact.paired for k, contact in enumerate(contacts) if contact.paired is not None}
    return ToolMemory(numbers, nodal, {name: values.reshape(cells, -1) for name, values in cellwise.items()},
                      [_corners_of(contact) for contact in contacts])


def remember(solver, memory: ToolMemory) -> None:
    """Take over what :func:`memory_of` gave. Collective."""
    body = solver.body
    body.displacement.x.array[body.dofs.ravel()] = memory.nodal["displacement"].ravel()
    body.set_held(memory.numbers["held"])
    solver.force = _vector(body, memory.nodal["force"])
    if isinstance(solver, ElasticSolver):
        return
    for name in _NUMBERS:
        setattr(solver, name, memory.numbers[name])
    solver._balanced = _vector(body, memory.nodal["balanced"])
    solver._accepted = body.displacement.x.array.copy()
    solver.bulk.remember(memory.cellwise, memory.numbers["flows"])
    if "heat" in memory.cellwise:
        solver._accepted_heat = memory.cellwise["heat"].ravel()
        body.set_thermal_strain(solver._accepted_heat)
    contacts, first = getattr(solver, "contacts", ()), body.nodes.comm.rank == 0
    for k, (contact, corners, works) in enumerate(zip(contacts, memory.between, memory.numbers["works"], strict=True)):
        paired = memory.nodal.get(f"paired {k}")
        contact.sharpen(corners.reshape(*contact.points.corners.shape, corners.shape[1])[..., -1])
        contact.pair_at(paired, None if paired is None else _vector(body, paired))
        _take_corners(contact, corners)
        contact.friction_work, contact.interference_work = works if first else (0.0, 0.0)
    if contacts:
        solver.go_on_with_contacts(memory.numbers["fresh"])
    solver._take_back()


def _vector(body, nodal: np.ndarray):
    vector = body.new_vector()
    owned = body.dofs < body.owned
    vector.array[body.dofs[owned]] = nodal[owned]
    return vector


# ---------------------------------------------------------------------- contacts of parts
def _corners_of(contact) -> np.ndarray:
    state, held, carried = contact.state, contact._hold, contact._carried
    columns = [state.pressure, state.active, held.slips, state.multiplier, state.friction_stress, state.slip, held.traction,
               held.along, *carried]
    rows = contact.carriers.at_corners(np.column_stack(columns))
    rows = np.concatenate([rows, contact.carriers.sharp_edges()[..., None]], axis=2)
    return rows.reshape(-1, rows.shape[-1])


def _take_corners(contact, corners: np.ndarray) -> None:
    rows = corners.reshape(*contact.points.corners.shape, corners.shape[1])
    values = contact.carriers.from_corners(rows)
    scalars, vectors = values[:, :3], values[:, 3:-1].reshape(len(values), -1, contact.dim)
    state = contact.state
    state.pressure, state.active, slips = scalars[:, 0], scalars[:, 1] > 0.5, scalars[:, 2] > 0.5
    multiplier, friction, slip, traction, along, *carried = (vectors[:, k].copy() for k in range(vectors.shape[1]))
    state.multiplier, state.friction_stress, state.slip = multiplier, friction, slip
    contact._hold = Hold(traction, np.zeros((len(values), contact.dim, contact.dim)), along, slips)
    contact._carried = tuple(carried)

