"""Closest points per second on every kind of tool surface: 20 000 points within 2 % of it, one thread.

Run with `env/run python3 benchmarks/closest_point.py`.
"""

from time import perf_counter

import numpy as np

from fenics_forming.physics.contact.polyline import Polyline
from fenics_forming.physics.contact.surfaces import Circle, Cylinder, Plane, Sphere
from fenics_forming.physics.contact.triangulated import Triangulated


def points_near(dimension, number=20_000, within=0.02, seed=0):
    """Random points whose distance to the unit sphere (3D) or circle (2D) is below `within`."""
    random = np.random.default_rng(seed)
    x = random.normal(size=(number, dimension))
    return x * (1 + random.uniform(-within, within, (number, 1))) / np.linalg.norm(x, axis=1)[:, None]


def ring(pieces):
    """Regular polygon in the unit circle."""
    turn = 2 * np.pi * np.arange(pieces) / pieces
    return Polyline(np.stack([np.cos(turn), np.sin(turn)], axis=1), closed=True)


def ball(rows):
    """Unit sphere in about 4 rows² triangles."""
    tilt, turn = np.linspace(0, np.pi, rows + 1)[:, None], np.linspace(0, 2 * np.pi, 2 * rows + 1)
    x, y, z = np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt) + 0 * turn
    first = (np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)).ravel()
    below = first + 2 * rows + 1
    return Triangulated(np.c_[x.ravel(), y.ravel(), z.ravel()],
                        np.r_[np.c_[first, below, below + 1], np.c_[first, below + 1, first + 1]])


def best_time(action, repeats=3):
    """Shortest of a few wall times in seconds, and the last result."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        result = action()
        times.append(perf_counter() - start)
    return min(times), result


def main():
    start = perf_counter()
    ring(65).closest(points_near(2, 1))
    ball(4).closest(points_near(3, 1))
    print(f"compiling, or loading what was compiled: {perf_counter() - start:.2f} s")
    print(f"{'surface':<24}{'build ms':>10}{'points/s':>12}{'off the round':>16}")
    cases = {
        "plane": lambda: Plane((0, 0, 0), (0, 0, 1)), "circle": lambda: Circle((0, 0), 1),
        "sphere": lambda: Sphere((0, 0, 0), 1), "cylinder": lambda: Cylinder((0, 0, 0), (0, 0, 1), 1),
        **{f"polyline {n}": lambda n=n: ring(n) for n in (16, 64, 65, 500, 5000)},
        **{f"triangles {4 * n * (n - 1)}": lambda n=n: ball(n) for n in (16, 50, 158)},
    }
    for name, build in cases.items():
        built, surface = best_time(build)
        x = points_near(surface.dimension)
        spent, (gap, _) = best_time(lambda surface=surface, x=x: surface.closest(x))
        other = name in ("plane", "cylinder")       # no unit sphere to compare with
        error = "" if other else f"{np.abs(np.abs(gap) - np.abs(np.linalg.norm(x, axis=1) - 1)).max():.1e}"
        print(f"{name:<24}{1e3 * built:>10.1f}{len(x) / spent:>12.2e}{error:>16}")


if __name__ == "__main__":
    main()
