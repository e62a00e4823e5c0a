"""What every time scheme makes of four flows that are known exactly; the table of docs/SHIFTING.md.

Run with `env/run python3 benchmarks/shifting.py`.
"""

from types import SimpleNamespace

import numpy as np

from fenics_forming import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.process.integration import Etd2, Explicit, Midpoint, Rotation, Trapezoid
from fenics_forming.process.meshes.transfer import integral
from fenics_forming.process.prescribed import PrescribedFlow, carry
from fenics_forming.process.substeps import Substeps

SCHEMES = {
    "`explicit`": (Explicit, "1"), "`substeps` = 3, plain": (lambda: Substeps(3), "1"),
    "`rotation`": (Rotation, "1"), "`etd2`": (Etd2, "1"),
    "`substeps` = 3, midpoint": (lambda: Substeps(3, "midpoint"), "1"),
    "`substeps` = 3, midpoint, rotation": (lambda: Substeps(3, "midpoint", True), "1"),
    "`midpoint`": (Midpoint, "2"), "`midpoint`, rotation": (lambda: Midpoint(rotation=True), "2"),
    "`trapezoid`": (lambda: Trapezoid(passes=30, tolerance=1e-8), "up to 9"),
    "`trapezoid`, rotation": (lambda: Trapezoid(passes=30, tolerance=1e-8, rotation=True), "up to 9"),
}


def compressed(scheme, steps=20):
    """Change of volume of a cylinder compressed without friction from 20 to 10 mm."""
    nodes = Nodes(meshing.rectangle((0, 0), (10, 20), (2, 3)))
    top, whole = np.isclose(nodes.x[:, 1], 20), SimpleNamespace(x=nodes.x, cells=nodes.cells)

    def follow(x, time):
        x[top, 1] = 20 - time

    volume = lambda: integral(whole, np.ones(len(nodes.x)), axisymmetric=True)  # noqa: E731
    start = volume()
    carry(PrescribedFlow(nodes, lambda x, t: x * [0.5, -1] / (20 - t), kinematics="axisymmetric", follow=follow),
          scheme, 10.0, steps)
    return volume() / start - 1


def ring(divisions=(4, 8)):
    """A quarter ring of radii 1 and 2."""
    nodes = Nodes(meshing.rectangle((0, 0), (np.log(2), np.pi / 2), divisions))
    radius, angle = np.exp(nodes.x[:, 0]), nodes.x[:, 1].copy()
    nodes.x[:] = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return nodes


def across(x):
    return np.column_stack([-x[:, 1], x[:, 0]])


def spun(scheme, steps=72):
    """Growth of the radius of a ring in a revolution of 5 degrees a step."""
    nodes = ring((2, 4))
    start = np.linalg.norm(nodes.x, axis=1)
    carry(PrescribedFlow(nodes, lambda x, t: 2 * np.pi * across(x)), scheme, 1.0, steps)
    return float(np.abs(np.linalg.norm(nodes.x, axis=1) / start - 1).max())


def swirled(scheme, steps):
    """Greatest error in an unsteady vortex with a sink, mm: 0.3 mm inwards and 1.4 rad around."""
    nodes = ring()
    x0 = nodes.x.copy()
    carry(PrescribedFlow(nodes, lambda x, t: (2 + 3 * t) * across(x) - 0.4 * (1 + t) * x / (x**2).sum(1, keepdims=True)),
          scheme, 0.5, steps)
    radius, angle = np.sqrt((x0**2).sum(1) - 0.5), np.arctan2(x0[:, 1], x0[:, 0]) + 1.375
    return np.abs(nodes.x - radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])).max()


def half_gap(x):
    s = np.clip(x / 2, 0, 1)
    return 1 - 0.5 * (3 * s**2 - 2 * s**3), -0.25 * (6 * s - 6 * s**2)


def extruded(scheme, steps=20):
    """Greatest error of the stream function along the way of a point through a die of reduction 2:1 and length 2."""
    nodes = Nodes(meshing.rectangle((-0.6, 0.6), (0.4, 1), (40, 16)))
    nodes.x[:, 1] *= half_gap(nodes.x[:, 0])[0]
    point = np.argmin(np.linalg.norm(nodes.x - [-0.2, 0.8], axis=1))

    def velocity(x, time):
        H, slope = half_gap(x[:, 0])
        return np.column_stack([1 / H, x[:, 1] * slope / H**2])

    errors = []
    carry(PrescribedFlow(nodes, velocity), scheme, 1.8, steps,
          after=lambda t: errors.append(abs(nodes.x[point, 1] / half_gap(nodes.x[point, 0])[0] - 0.8)))
    return max(errors)


def main() -> None:
    """Measure and print."""
    print("| Scheme | solves a step | order | vortex, 40 steps | volume, 20 steps | ring, a turn | die, 20 steps |")
    print("|---|---|---|---|---|---|---|")
    for name, (make, solves) in SCHEMES.items():
        coarse, fine = swirled(make(), 20), swirled(make(), 40)
        growth = spun(make())
        grown = "0" if growth < 1e-12 else f"{growth:.1e}"
        print(f"| {name} | {solves} | {np.log2(coarse / fine):.2f} | {fine:.1e} | {compressed(make()):+.1e} | "
              f"{grown} | {extruded(make()):.1e} |")


if __name__ == "__main__":
    main()
