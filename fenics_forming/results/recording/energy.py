"""What is recorded of bodies with inertia: kinetic energy, momentum, and whether both balance."""

from __future__ import annotations

import numpy as np


class MotionRecord:
    """Energy and momentum of a run, of the whole body (all mirrored parts); nothing where no inertia acts.

    Parameters
    ----------
    run : the simulation
    copies : f() → parts of the whole body that the mesh stands for
    """

    def __init__(self, run, copies):
        self.run, self._copies = run, copies
        scene = run.scene
        mirrored = {axis for body in scene.workpieces.values() for axis in body.symmetry}
        self._axes = [a for a in scene.axes if a not in mirrored and a != "r"]
        self._per = "_per_mm" if scene.geometry == "plane_strain" else ""
        self.worst = 0.0

    @property
    def inertia(self):
        """What the body knows of its motion, or None."""
        return self.run.body.inertia

    def row(self) -> dict[str, float]:
        """Columns of kinetic energy, momentum and the relative energy imbalance."""
        if self.inertia is None:
            return {}
        energies, momentum, copies = self.inertia.energies(), self.inertia.momentum(), self._copies()
        row = {f"kinetic_energy_mJ{self._per}": energies["kinetic"] * copies}
        for axis in self._axes:
            row[f"momentum_{axis}_Ns{self._per}"] = float(momentum[self.run.scene.axes.index(axis)]) * copies
        return row | {"energy_imbalance": self._relative(energies)}

    def _relative(self, energies: dict[str, float]) -> float:
        size = energies["start"] + abs(energies["tools"]) + abs(energies["weight"])
        relative = float(energies["imbalance"] / size) if size > 0 else 0.0
        self.worst = max(self.worst, abs(relative))
        return relative

    def summary(self) -> dict:
        """Energies, mJ, and momenta, N s, of the run; what of the momentum no impulse accounts for, relative to what
        there was of momentum and impulse."""
        if self.inertia is None:
            return {}
        copies = self._copies()
        energies = {name: float(value) * copies for name, value in self.inertia.energies().items()}
        size = float(np.abs(self.inertia.greatest_momentum()).max())
        momenta, errors = self.inertia.momentum(), self.inertia.momentum_error()
        momentum = {axis: {"now": float(momenta[k]) * copies, "relative_error": float(errors[k] / (size or 1.0))}
                    for k, axis in enumerate(self.run.scene.axes) if axis in self._axes}
        return {"energy": {"mJ": energies, "worst_relative_imbalance": self.worst}, "momentum_Ns": momentum}
