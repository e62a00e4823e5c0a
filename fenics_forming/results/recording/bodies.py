"""What is recorded body by body: volumes, extents, damage, and what several bodies do to one another."""

from __future__ import annotations

import numpy as np

from ...physics.parallel import highest, lowest, total
from ...scene import Contact, copies
from .ledger import DamageLedger

UNITS = {"temperature": "temperature_degC"}     # names of the history as results have them


def resultant_columns(contact: Contact, slave: str, force: np.ndarray, along: dict[str, int], unit: str) -> dict:
    """Columns of the force of the second body of a contact on the first, along every axis on which it has a resultant.

    force : (dim,) on the ``slave``, of the part that is modelled · along : axis → parts on which the same acts, in order
    """
    sign = 1.0 if contact.between[0] == slave else -1.0
    return {f"resultant_{contact.name.replace('-', '_')}_{axis}_{unit}": sign * float(force[k]) * count + 0.0
            for k, (axis, count) in enumerate(along.items()) if axis != "r"}


class BodyRecord:
    """The bodies of a run; of several there are columns of their own for each.

    Parameters
    ----------
    run : the simulation
    """

    def __init__(self, run):
        self.run, self.scene, self.comm = run, run.scene, run.comm
        self.several = self.scene.is_assembled
        laws = {name: self.scene.materials[body.material].damage for name, body in self.scene.workpieces.items()}
        self.damage = {name: DamageLedger(law.critical) for name, law in laws.items() if law is not None}

    # ------------------------------------------------------------------ rows
    def copies(self, direction=None, name: str | None = None) -> int:
        """Parts of the whole body that the mesh stands for (``scene.copies``)."""
        return copies(self.scene, direction, name)

    def volumes(self) -> dict[str, float]:
        """Columns of volumes and their errors."""
        body, row = self.run.body, {}
        volumes = body.volumes() if self.several else {self.scene.workpiece_name: body.free_surface.volume(body.x)}
        errors = self.run.volume_ledger.errors(volumes)
        for name, volume in volumes.items():
            row[f"volume_{name}_mm3"] = volume * self.copies(name=name)
            row[f"volume_error_{name}"] = errors[name]
        return row

    def maxima(self, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Columns of the largest values of what gathers in the material, of several bodies also of each."""
        row = {f"max_{name}": self._largest(values) for name, values in in_words(history).items()}
        if "temperature" in history:
            row["min_temperature_degC"] = -self._largest(-history["temperature"])
        for gathered, values in history.items() if self.several else ():
            for body in self._parts.names:
                unit = "_degC" * (gathered == "temperature")
                row[f"max_{gathered}_{body}{unit}"] = self._largest(values[self._mine(body)])
                if unit:
                    row[f"min_{gathered}_{body}{unit}"] = -self._largest(-values[self._mine(body)])
        return row

    def contact_forces(self, unit: str, share: float) -> dict[str, float]:
        """Columns of the forces that press bodies on one another: ``share`` of the sum of the pressure over their common
        surface, and of the resultant of all tractions there."""
        interfaces, row = self.run.body.interfaces, {}
        if interfaces is None:
            return row
        along = {axis: self.copies(np.eye(self.scene.dimension)[k]) for k, axis in enumerate(self.scene.axes)}
        given = {contact.name: contact for contact in self.scene.contacts}
        for name, contact in interfaces.by_name.items():
            force = share * float(total(self.comm, contact.state.pressure @ contact.weights))
            row[f"contact_force_{name.replace('-', '_')}_{unit}"] = force * self.copies()
            row |= resultant_columns(given[name], interfaces.slaves[name], share * contact.force(), along, unit)
        return row

    def temperature_of(self, point: str) -> float | None:
        """Temperature of the body of a tracked point, degC, where it stays as it was given."""
        if self.scene.computes_heat:
            return None
        return self.scene.workpieces[self.scene.points[point].body].temperature

    # ------------------------------------------------------------------ damage
    def damage_news(self, row: dict[str, float]) -> list[str]:
        """A sentence for every body in whose row the critical damage is passed."""
        news = []
        for name, ledger in self.damage.items():
            said = ledger.news(int(row["step"]), row[f"max_damage_{name}" if self.several else "max_damage"])
            news += [f"{name}: {sentence}" for sentence in said] if self.several else said
        return news

    def damage_summary(self) -> dict:
        """What the ledger of damage says; of several bodies that of each, by name."""
        found = {name: ledger.summary() for name, ledger in self.damage.items()}
        return found if self.several else next(iter(found.values()))

    # ------------------------------------------------------------------ the end
    def extents(self) -> dict[str, dict[str, list[float]]]:
        """Body → axis → lowest and highest coordinate, mm."""
        nodes = self.run.nodes
        found = {}
        for name in self.scene.workpieces:
            x = nodes.x[self._mine(name)] if self.several else nodes.x
            low, high = lowest(self.comm, x.min(axis=0, initial=np.inf)), highest(self.comm, x.max(axis=0, initial=-np.inf))
            found[name] = {a: [float(lo), float(hi)] for a, lo, hi in zip(self.scene.axes, low, high, strict=True)}
        return found

    def parts_built(self) -> list[str]:
        """Laws of damage and contacts between bodies, as words."""
        laws = {law.law: None for body in self.scene.workpieces.values()
                if (law := self.scene.materials[body.material].damage) is not None}
        return [*(f"contact {contact.name}: {contact.friction.law}" for contact in self.scene.contacts),
                *(f"damage {law}" for law in laws)]

    def cell_data(self) -> dict[str, np.ndarray] | None:
        """Number of its body for every cell, where there are several."""
        return {"body": self._parts.of_cell.astype(np.int32)} if self.several else None

    @property
    def _parts(self):
        return self.run.body.parts

    def _mine(self, name: str) -> np.ndarray:
        return self._parts.of_node == self._parts.names.index(name)

    def _largest(self, values: np.ndarray) -> float:
        return highest(self.comm, float(values.max(initial=-np.inf)))


def in_words(history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The history with names as results have them, with units where there are any."""
    return {UNITS.get(name, name): values for name, values in history.items()}
