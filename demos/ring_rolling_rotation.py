"""A ring that rolls: most of it only turns, and a step that follows the velocity along a straight line blows it up.

Two pairs of rolls, opposite to each other, thin the wall of a ring that spins between them at constant height. What lies
in a gap moves outwards while it passes; everything else turns as a rigid body. So the ring grows, and by how much is set
by its volume alone. Instead of solving for the flow, a stand-in for it is prescribed, free of divergence,

    v = w r e_phi + C m(phi)/r e_r ,     m: a bump in either gap, 1 on the mean over a turn,

so that every material point ends at r² = r0² + 2 C T after whole half turns, and what the time schemes make of it can be
read off the diameters. They are those of the package, at work on a mesh of order 2.

    python3 demos/ring_rolling_rotation.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from demos.comparison import Compared, compare
from fenics_forming import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.process.integration import Etd2, Explicit, Midpoint, Rotation, Scheme
from fenics_forming.process.prescribed import PrescribedFlow, carry
from fenics_forming.process.substeps import Substeps

OUTER, INNER, WALL = 100.0, 50.0, 25.0     # radii at the start, wall at the end, mm
REVOLUTIONS = 6
STEPS = 72                                 # a revolution: 5 degrees each
GAP = np.deg2rad(25.0)                     # half the angle that a pair of rolls takes of the ring
WALLS = {40.0: (227.5, 147.5), 30.0: (280.0, 220.0), 25.0: (325.0, 275.0)}   # mm → diameters at constant volume, mm


def growth_to(wall: float) -> float:
    """Growth 2 C t of the squared radii until the wall is so thick, mm²: (sum of the radii) x wall stays as it is."""
    return (0.5 * ((OUTER**2 - INNER**2) / wall + wall)) ** 2 - OUTER**2


GROWTH = growth_to(WALL)

SCHEMES: dict[str, Callable[[], Scheme]] = {
    "rotation": Rotation, "etd2": Etd2, "midpoint, rotation": lambda: Midpoint(rotation=True), "midpoint": Midpoint,
    "3 sub-steps": lambda: Substeps(3), "explicit": Explicit}
SAFE = {"rotation", "etd2", "midpoint, rotation"}


@dataclass
class Rolled:
    """What one scheme made of the ring.

    revolutions, outer, inner : at the start and after every step; diameters in mm, of the mean of the squared radii
    x : positions of the nodes at the end, mm · cells : their cells · strain : effective strain at the nodes
    """

    revolutions: list[float] = field(default_factory=list)
    outer: list[float] = field(default_factory=list)
    inner: list[float] = field(default_factory=list)
    x: np.ndarray | None = None
    cells: np.ndarray | None = None
    strain: np.ndarray | None = None

    def at_wall(self, wall: float) -> tuple[float, float]:
        """Outer and inner diameter when the exact wall has that thickness, mm."""
        turns = REVOLUTIONS * growth_to(wall) / GROWTH
        return tuple(float(np.interp(turns, self.revolutions, values)) for values in (self.outer, self.inner))


def main(coarse: bool = False, out: str | Path = "results/ring_rolling_rotation", quiet: bool = False
         ) -> dict[str, Rolled]:
    """Roll the ring by every scheme, compare the diameters, draw.

    Parameters
    ----------
    coarse : larger elements; the steps stay, as it is they that matter
    out : folder for the picture
    quiet : print nothing

    Returns
    -------
    name of the scheme → what it made of the ring
    """
    runs = {name: roll(make(), 20.0 if coarse else 10.0) for name, make in SCHEMES.items()}
    Path(out).mkdir(parents=True, exist_ok=True)
    picture(runs, Path(out) / "ring_rolling.png")
    compare([row for name, run in runs.items() for row in compared(name, run)], quiet=quiet)
    return runs


def velocity(x: np.ndarray, time: float) -> np.ndarray:
    """Velocities (n, 2), mm/s, at points (n, 2); a revolution takes a second."""
    angle = np.arctan2(x[:, 1], x[:, 0])
    from_gap = np.abs((angle + np.pi / 2) % np.pi - np.pi / 2)          # one gap at 0, one at 180 degrees
    bump = np.where(from_gap < GAP, np.pi / GAP * np.cos(0.5 * np.pi * from_gap / GAP) ** 2, 0.0)
    outwards = 0.5 * GROWTH / REVOLUTIONS * bump / (x**2).sum(axis=1)
    return 2 * np.pi * np.column_stack([-x[:, 1], x[:, 0]]) + outwards[:, None] * x


def roll(scheme: Scheme, size: float) -> Rolled:
    """The ring in elements of ``size`` mm, carried by one scheme."""
    def build(gmsh):
        disks = [gmsh.model.occ.addDisk(0, 0, 0, r, r) for r in (OUTER, INNER)]
        gmsh.model.occ.cut([(2, disks[0])], [(2, disks[1])])
        gmsh.model.occ.synchronize()

    nodes = Nodes(meshing.generate(build, 2, size))
    radius = np.linalg.norm(nodes.x, axis=1)
    on = [np.abs(radius - r) < 1e-6 * r for r in (OUTER, INNER)]
    run = Rolled(cells=nodes.cells)

    def measure(time):
        run.revolutions.append(time)
        for values, side in zip((run.outer, run.inner), on, strict=True):
            values.append(2 * float(np.sqrt((nodes.x[side] ** 2).sum(axis=1).mean())))

    measure(0.0)
    run.strain = carry(PrescribedFlow(nodes, velocity), scheme, float(REVOLUTIONS), REVOLUTIONS * STEPS,
                       after=measure)["effective_strain"]
    run.x = nodes.x.copy()
    return run


def blown_up(r0: float) -> float:
    """Diameter that the explicit shift ends with: r² becomes (1 + angle²) r² + 2 C dt in every step."""
    angle, steps = 2 * np.pi / STEPS, REVOLUTIONS * STEPS
    growth = (1 + angle**2) ** steps
    return 2 * float(np.sqrt(growth * r0**2 + GROWTH / steps * (growth - 1) / angle**2))


def compared(name: str, run: Rolled) -> list[Compared]:
    """The diameters of one scheme beside their references."""
    if name in SAFE:
        rows = [Compared(f"{name}: {which} diameter at a wall of {wall:g} mm, mm", ours, exact, 0.005, "volume")
                for wall, diameters in WALLS.items() if name == "rotation" or wall == WALL
                for which, ours, exact in zip(("outer", "inner"), run.at_wall(wall), diameters, strict=True)]
        wall = 0.5 * (run.outer[-1] - run.inner[-1])
        return [*rows, Compared(f"{name}: wall at the end, mm", wall, WALL, 0.005, "volume")]
    if name == "explicit":
        # the law counts the growth in the gaps on the mean over a turn; here the last turn is not a whole one
        return [Compared(f"{name}: {which} diameter at the end, mm", values[-1], blown_up(r0), 0.02, "law of the scheme")
                for which, values, r0 in (("outer", run.outer, OUTER), ("inner", run.inner, INNER))]
    return []


def picture(runs: dict[str, Rolled], path: Path) -> None:
    """The ring before and after, and its outer diameter over the revolutions."""
    figure, (shape, curve) = plt.subplots(1, 2, figsize=(10.6, 4.9), layout="constrained", width_ratios=(1, 1.1))
    run = runs["rotation"]
    triangles = run.cells[:, :3]
    colours = shape.tripcolor(*run.x.T, triangles, run.strain, shading="gouraud")
    figure.colorbar(colours, ax=shape, shrink=0.8, label="effective strain (–)")
    around = np.linspace(0, 2 * np.pi, 200)
    for r in (OUTER, INNER):
        shape.plot(r * np.cos(around), r * np.sin(around), color="0.6", linewidth=0.9)
    for side in (0, np.pi):      # where the rolls are
        for angle in (side - GAP, side + GAP):
            shape.plot([0, 185 * np.cos(angle)], [0, 185 * np.sin(angle)], "k:", linewidth=0.7)
    shape.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", title="Before (grey) and after six turns")
    turns = np.linspace(0, REVOLUTIONS, 100)
    curve.plot(turns, 2 * np.sqrt(OUTER**2 + GROWTH * turns / REVOLUTIONS), "k", linewidth=3, alpha=0.25, label="exact")
    for name, other in runs.items():
        curve.plot(other.revolutions, other.outer, "-" if name in SAFE else "--", linewidth=1.2, label=name)
    for diameter, _ in WALLS.values():
        curve.plot(REVOLUTIONS * ((diameter / 2) ** 2 - OUTER**2) / GROWTH, diameter, "ks", markerfacecolor="none")
    curve.set(xlabel="revolutions", ylabel="outer diameter (mm)", ylim=(190, 620), title="Steps of 5 degrees")
    curve.grid(True, linewidth=0.5, alpha=0.4)
    curve.legend(frameon=False, fontsize="small")
    figure.savefig(path, dpi=85)
    plt.close(figure)


if __name__ == "__main__":
    main()
