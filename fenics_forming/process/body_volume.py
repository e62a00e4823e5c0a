"""The volume of a flowing body: what it is, what has changed it, and how it is restored."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from ..physics.parallel import highest
from .volume import FreeSurface, Restored


class BodyVolume:
    """What a `FlowingBody` knows of its volume; mixed into it."""

    def returned_volume(self) -> float:
        """Change of volume, mm³, by the nodes that the last placing put back onto the tools. Collective."""
        moved = (self.x[self.boundary] != self._as_shifted).any()
        if not highest(self.nodes.comm, float(moved)):
            return 0.0
        shifted = self._before_placing()
        return self.free_surface.volume(self.x) - self.free_surface.volume(shifted)

    def returned_volumes(self) -> dict[str, float]:
        """The same of several bodies, by name. Collective."""
        shifted = self._before_placing()
        return {name: s.volume(self.x) - s.volume(shifted) for name, s in self.surfaces.items()}

    def volumes(self) -> dict[str, float]:
        """Volumes of several bodies now, mm³ (mm² in plane strain), by name. Collective."""
        return {name: surface.volume(self.x) for name, surface in self.surfaces.items()}

    def skins(self) -> list[tuple[FreeSurface, np.ndarray]]:
        """The free surface of every body, and its cells of this rank, (cells, nodes of a cell)."""
        if self.free_surface is not None:
            return [(self.free_surface, self.nodes.cells)]
        return [(surface, self.nodes.cells[self.parts.cells_of(name)]) for name, surface in self.surfaces.items()]

    def _before_placing(self) -> np.ndarray:
        shifted = self.x.copy()
        shifted[self.boundary] = self._as_shifted
        return shifted

    def restore_volume(self, volume: float) -> Restored:
        """Offset the free surface until the body has the given volume, mm³; pressed nodes stay. Collective."""
        return self._restore(self.free_surface, volume)

    def restore_volumes(self, volumes: dict[str, float]) -> dict[str, Restored]:
        """The same of several bodies, by name; what they press on one another with stays. Collective."""
        return {name: self._restore(surface, volumes[name]) for name, surface in self.surfaces.items()}

    def _restore(self, surface: FreeSurface, volume: float) -> Restored:
        start = perf_counter()
        pressed = sum(self._pressed_nodes().values(), np.zeros(self.nodes.count, bool))
        between = self.interfaces is not None and not self.workpiece.is_cold
        done = surface.offset_around(volume, self.x, self.tools, pressed=pressed,
                                     met=self.interfaces.pressed_nodes() if between else None)
        self.seconds["shifting"] += perf_counter() - start
        return done
