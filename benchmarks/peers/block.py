"""One eighth of a cube of 30 mm between sticking platens in CalculiX: 20-node hexahedra, large strains, no contact."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import calculix


@dataclass(frozen=True)
class Block:
    """The face moves down as one piece; free sides may bulge past the platen."""

    cells: int
    size: float = 15.0
    reduction: float = 0.2
    flow_curve: tuple = ((700, 0), (1900, 4))
    young: float = 200e3
    poisson: float = 0.3
    element: str = "C3D20R"
    increment: float = 0.005            # of the height
    stations: int = 2

    def deck(self) -> calculix.Deck:
        deck, last = calculix.Deck(), 2 * self.cells
        body = deck.grid("BODY", self.element, (0, 0, 0), (self.size,) * 3, (self.cells,) * 3)
        for axis, name in enumerate(("LOWX", "LOWY", "LOWZ")):
            deck.node_set(name, [n for key, n in body.items() if key[axis] == 0])
        deck.node_set("FACE", [n for key, n in body.items() if key[2] == last])
        deck.node_set("SIDE", [body[last, 0, 0]])
        deck.add(*calculix.elastic_plastic("METAL", self.young, self.poisson, self.flow_curve),
                 "*SOLID SECTION,ELSET=BODY,MATERIAL=METAL", "*BOUNDARY", "LOWX,1", "LOWY,2", "LOWZ,3", "FACE,1,2")
        part = self.increment / self.reduction * self.stations
        for station in range(1, self.stations + 1):
            deck.add("*STEP,NLGEOM,INC=1000", "*STATIC", f"{part},1.,1e-6,{part}", "*BOUNDARY",
                     f"FACE,3,3,{-self.reduction * self.size * station / self.stations}",
                     "*NODE PRINT,NSET=FACE,TOTALS=ONLY", "RF", "*NODE PRINT,NSET=SIDE", "U",
                     "*NODE FILE,FREQUENCY=10000", "U", "*END STEP")
        return deck

    def run(self, folder: Path, limit: float) -> dict:
        """Cost, and force (kN, of the whole block) and half width (mm) at every station that was reached."""
        done = calculix.run(self.deck(), folder, limit)
        forces, moved = done.total_forces("FACE"), done.printed("displacements", "SIDE")
        rows = {}
        for station in range(1, self.stations + 1):
            time = next((t for t in forces if abs(t - station) < 1e-6), None)
            if time is not None:
                rows[station] = {"force_kN": -forces[time][2] * 4e-3, "half_width_mm": self.size + moved[time][0][1]}
        return {"finished": done.finished, "cpu_s": done.cpu_s, "peak_mb": done.peak_mb, "stations": rows,
                "reduction_reached": max(forces, default=0.0) * self.reduction / self.stations}
