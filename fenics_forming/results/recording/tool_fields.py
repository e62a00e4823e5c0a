"""Fields and numbers of a deformed tool under names that carry their units."""

from __future__ import annotations

import numpy as np

from ...physics.parallel import highest, lowest, total


def point_data(field, contacts=(), rotation: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """What a frame shows of a `ToolField`, by name, at the nodes; with contacts also the pressure between the parts.

    rotation : (dim, dim) from the frame of a tool that has turned to that of space
    """
    shift = field.displacement if rotation is None else field.displacement @ rotation.T
    data = {"displacement_mm": shift, "von_mises_MPa": field.von_mises, "mean_stress_MPa": field.mean_stress}
    data |= stresses(field, rotation)
    if field.body.yields:
        data["effective_strain"] = field.plastic_strain
    if contacts:
        from ...physics.contact.bodies import nodal_pressure
        data["contact_pressure_MPa"] = sum(nodal_pressure(field.body.nodes, [contact]) for contact in contacts)
    return data


def stresses(field, rotation: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Components of the stress by name, such as "stress_rr_MPa"."""
    values = field.stress if rotation is None else _turned(field, rotation)
    return {f"stress_{name}_MPa": of_one for name, of_one in zip(field.components, values.T, strict=True)}


def _turned(field, rotation: np.ndarray) -> np.ndarray:
    """Components of the stress in space, (nodes, c): R sigma Rᵀ."""
    axes = "xyz"
    where = [(axes.index(first), axes.index(second)) for first, second in field.components]
    rows, columns = np.transpose(where)
    stress, turn = np.zeros((len(field.stress), 3, 3)), np.eye(3)
    stress[:, rows, columns] = stress[:, columns, rows] = field.stress
    turn[: len(rotation), : len(rotation)] = rotation
    return (turn @ stress @ turn.T)[:, rows, columns]


def contact_numbers(contact, comm) -> dict[str, float]:
    """Force with which two parts press on one another, N, the sum over their surface, and its mean where they touch, MPa.
    Collective."""
    state, w = contact.state, contact.weights
    closed = state.active & np.isfinite(state.gap)
    force, area = total(comm, np.array([state.pressure[closed] @ w[closed], w[closed].sum()]))
    return {"force": float(force), "pressure": float(force / area) if area else 0.0}


def tracked(field, points, axes, motion=None) -> dict[str, float]:
    """Columns of tracked points in a tool: place, displacement, plastic strain, stresses in its own frame. With the motion
    of the tool places are those in space. Collective."""
    place = field.x + field.displacement
    place = place if motion is None else motion.to_space(place)
    columns = {f"{a}_mm": values for a, values in zip(axes, place.T, strict=True)}
    columns |= {f"displacement_{a}_mm": values for a, values in zip(axes, field.displacement.T, strict=True)}
    plastic = field.plastic_strain
    columns |= {"effective_strain": np.zeros(len(field.x)) if plastic is None else plastic,
                "mean_stress_MPa": field.mean_stress, "von_mises_MPa": field.von_mises, **stresses(field)}
    row = {}
    for label, (values,) in points.values(np.column_stack(list(columns.values()))).items():
        row |= {f"{label}_{column}": float(value) for column, value in zip(columns, values, strict=True)}
    return row


def part_numbers(field, parts, name: str) -> dict:
    """Largest displacement and stress of a part, how much of it has flowed, and its extents now. Collective."""
    body, comm = field.body, field.body.nodes.comm
    mine = parts.of_node == parts.names.index(name)
    moved = body.nodes.x[mine] + field.displacement[mine]
    found = {"largest_displacement_mm": highest(comm, _largest(np.linalg.norm(field.displacement[mine], axis=1))),
             "largest_von_mises_MPa": highest(comm, _largest(field.von_mises[mine]))}
    if body.yields:
        rows = body.points_of(parts.cells_of(name))
        flowed, whole = total(comm, np.array([body.volumes[rows] @ (field.solver.plastic.effective[rows] > 0),
                                              body.volumes[rows].sum()]))
        found |= {"largest_effective_strain": highest(comm, _largest(field.plastic_strain[mine])),
                  "share_that_flowed": float(flowed / whole)}
    low, high = lowest(comm, moved.min(axis=0, initial=np.inf)), highest(comm, moved.max(axis=0, initial=-np.inf))
    return found | {"extents_mm": np.array([low, high])}


def energies(field) -> dict[str, float]:
    """Work of loads and overlaps and where it went, mJ (mJ/mm in the plane), of the part that is meshed. Collective."""
    found = {"external_work_mJ": field.external_work, "elastic_energy_mJ": field.elastic_energy,
             "spring_energy_mJ": field.spring_energy, "plastic_work_mJ": field.plastic_work}
    if field.body.heating is not None:
        found["thermal_work_mJ"] = field.thermal_work
    if getattr(field.solver, "contacts", ()):
        found |= {"interference_work_mJ": field.solver.interference_work, "friction_work_mJ": field.solver.friction_work}
    return found


def imbalance(energies: dict[str, float]) -> float:
    """What is missing of the work that was done, relative to it."""
    given = energies["external_work_mJ"] + energies.get("interference_work_mJ", 0.0)
    taken = sum(value for name, value in energies.items() if name not in ("external_work_mJ", "interference_work_mJ"))
    scale = max(abs(given), abs(taken))
    return abs(given - taken) / scale if scale else 0.0


def _largest(values) -> float:
    return float(values.max(initial=0.0))
