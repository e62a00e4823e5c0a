"""Billets and rings between rigid platens in CalculiX: quadratic axisymmetric elements, large strains, penalty contact."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import calculix


@dataclass(frozen=True)
class Upsetting:
    """The upper half of a ring, or of a billet where the bore is zero, under a platen of elastic elements that is held in
    all its nodes. Lengths mm, stresses MPa."""

    bore: float
    radius: float
    half_height: float
    reduction: float
    flow_curve: tuple                   # pairs of stress and plastic strain
    cells: tuple[int, int]
    friction: float | str = "bonded"    # Coulomb coefficient, or "bonded": the face is clamped, sides that fold may touch
    young: float = 200e3
    poisson: float = 0.3
    element: str = "CAX8R"
    contact: str = "NODE TO SURFACE"
    penalty: float = 1e5                # N/mm^3
    stick: float = 1e4                  # N/mm^3
    increment: float = 0.005            # of the height
    stations: int = 6

    def deck(self) -> calculix.Deck:
        deck, (across, up) = calculix.Deck(), self.cells
        body = deck.grid("BODY", self.element, (self.bore, 0), (self.radius, self.half_height), self.cells)
        wide = (max(0.0, self.bore - 0.7 * self.half_height), 2.2 * self.radius)
        layers = max(20, round(across * (wide[1] - wide[0]) / (self.radius - self.bore)))
        platen = deck.grid("PLATEN", self.element, (wide[0], self.half_height), (wide[1], self.half_height + 2),
                           (layers, 1))
        sets = {"MIDDLE": [n for (_, j), n in body.items() if j == 0],
                "FACE": [n for (_, j), n in body.items() if j == 2 * up],
                "PLATENS": platen.values(), "EQUATOR": [body[2 * across, 0]], "BORE": [body[0, 0]],
                "AXIS": [n for (i, _), n in body.items() if i == 0]}
        for name, numbers in sets.items():
            deck.node_set(name, numbers)
        bonded, hollow = self.friction == "bonded", self.bore > 0
        # the grid numbers its elements along the radius first
        touching = [f"{j * across + across},S2" for j in range(up)] + [f"{j * across + 1},S4" for j in range(up) if hollow]
        if not bonded:
            touching += [f"{(up - 1) * across + i + 1},S3" for i in range(across)]
        deck.add("*SURFACE,NAME=OUTSIDE", *touching, "*SURFACE,NAME=UNDERSIDE",
                 *(f"{across * up + k + 1},S1" for k in range(layers)),
                 *calculix.elastic_plastic("METAL", self.young, self.poisson, self.flow_curve),
                 *calculix.elastic_plastic("TOOL", self.young, self.poisson),
                 "*SOLID SECTION,ELSET=BODY,MATERIAL=METAL", "*SOLID SECTION,ELSET=PLATEN,MATERIAL=TOOL",
                 "*SURFACE INTERACTION,NAME=TOUCH", "*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR", f"{self.penalty:g}")
        if self.friction:
            deck.add("*FRICTION", f"{2.0 if bonded else self.friction},{self.stick:g}")
        deck.add(f"*CONTACT PAIR,INTERACTION=TOUCH,TYPE={self.contact}", "OUTSIDE,UNDERSIDE",
                 "*BOUNDARY", "MIDDLE,2", "PLATENS,1", *(["FACE,1"] if bonded else []), *([] if hollow else ["AXIS,1"]))
        part = self.increment / self.reduction * self.stations
        for station in range(1, self.stations + 1):
            down = -self.reduction * self.half_height * station / self.stations
            deck.add("*STEP,NLGEOM,INC=1000", "*STATIC", f"{part},1.,1e-6,{part}", "*BOUNDARY", f"PLATENS,2,2,{down}",
                     *([f"FACE,2,2,{down}"] if bonded else []), "*NODE PRINT,NSET=PLATENS,TOTALS=ONLY", "RF",
                     "*NODE PRINT,NSET=FACE,TOTALS=ONLY", "RF", "*NODE PRINT,NSET=EQUATOR", "U",
                     "*NODE PRINT,NSET=BORE", "U", "*NODE FILE,FREQUENCY=10000", "U", "*END STEP")
        return deck

    def run(self, folder: Path, limit: float) -> dict:
        """Cost, and force (kN, of the full circle) and radii (mm) at every station that was reached."""
        done = calculix.run(self.deck(), folder, limit)
        names = ("PLATENS", "FACE") if self.friction == "bonded" else ("PLATENS",)
        forces = done.total_forces(*names)
        moved = {name: done.printed("displacements", name) for name in ("EQUATOR", "BORE")}
        rows = {}
        for station in range(1, self.stations + 1):
            time = next((t for t in forces if abs(t - station) < 1e-6), None)
            if time is not None:
                rows[station] = {"force_kN": -forces[time][1] * calculix.SECTORS * 1e-3,
                                 "radius_mm": self.radius + moved["EQUATOR"][time][0][1],
                                 "bore_mm": self.bore + moved["BORE"][time][0][1]}
        return {"finished": done.finished, "cpu_s": done.cpu_s, "peak_mb": done.peak_mb, "stations": rows,
                "reduction_reached": max(forces, default=0.0) * self.reduction / self.stations}
