"""Two rings shrunk onto one another in CalculiX: quadratic elements of a section, penalty contact (REFERENCES.md 6.2)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import calculix


@dataclass(frozen=True)
class ShrinkFit:
    """A slice of rings of radii a < b < c in plane strain that overlap by ``interference`` on the radius, mm and MPa."""

    cells: int                          # over the wall of the inner ring
    inner: float = 20.0
    joint: float = 40.0
    outer: float = 80.0
    interference: float = 0.04
    height: float = 5.0
    young: float = 210e3
    poisson: float = 0.3
    penalty: float = 1e7                # N/mm^3
    element: str = "CAX8"
    contact: str = "SURFACE TO SURFACE"

    @property
    def pressure(self) -> float:
        """Exact pressure at the joint, MPa."""
        a, b, c = self.inner**2, self.joint**2, self.outer**2
        return (self.young * self.interference / self.joint * (b - a) * (c - b) / (2 * b * (c - a)) / (1 - self.poisson**2))

    def deck(self) -> calculix.Deck:
        deck, wall = calculix.Deck(), self.joint - self.inner
        up = max(1, round(self.cells * self.height / wall))
        liner = deck.grid("LINER", self.element, (self.inner, 0), (self.joint + self.interference, self.height),
                          (self.cells, up))
        wide = round(self.cells * (self.outer - self.joint) / wall)
        sleeve = deck.grid("SLEEVE", self.element, (self.joint, 0), (self.outer, self.height), (wide, up + 1))
        deck.node_set("ENDS", [n for grid in (liner, sleeve) for (_, j), n in grid.items()
                               if j in (0, max(k for _, k in grid))])
        deck.node_set("BORE", [n for (i, j), n in liner.items() if i == 0])
        first = self.cells * up
        deck.add("*SURFACE,NAME=OUTSIDE", *(f"{j * self.cells + self.cells},S2" for j in range(up)),
                 "*SURFACE,NAME=INSIDE", *(f"{first + j * wide + 1},S4" for j in range(up + 1)),
                 *calculix.elastic_plastic("STEEL", self.young, self.poisson),
                 "*SOLID SECTION,ELSET=LINER,MATERIAL=STEEL", "*SOLID SECTION,ELSET=SLEEVE,MATERIAL=STEEL",
                 "*SURFACE INTERACTION,NAME=TOUCH", "*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR", f"{self.penalty:g}",
                 f"*CONTACT PAIR,INTERACTION=TOUCH,TYPE={self.contact}", "OUTSIDE,INSIDE", "*BOUNDARY", "ENDS,2",
                 "*STEP", "*STATIC", "1.,1.", "*NODE PRINT,NSET=BORE", "U", "*NODE FILE", "U", "*EL FILE", "S", "*END STEP")
        return deck

    def run(self, folder: Path, limit: float) -> dict:
        """Cost and the pressure (MPa) that Lamé's formula gives for how much the bore has narrowed."""
        done = calculix.run(self.deck(), folder, limit)
        moved = done.printed("displacements", "BORE")
        if not done.finished:
            return {"finished": False, "cpu_s": done.cpu_s, "peak_mb": done.peak_mb, "stations": {},
                    "reduction_reached": 0.0}
        lines = moved[max(moved)]
        narrowed = -sum(line[1] for line in lines) / len(lines)
        a, b = self.inner**2, self.joint**2
        # u(a) of a ring under outside pressure p in plane strain: -2 p a b^2 (1 - nu^2) / (E (b^2 - a^2))
        pressure = narrowed * self.young * (b - a) / (2 * self.inner * b * (1 - self.poisson**2))
        return {"finished": True, "cpu_s": done.cpu_s, "peak_mb": done.peak_mb, "stations": {1: {"pressure_MPa": pressure}},
                "reduction_reached": 1.0}
