"""A flush block between rough platens, w/h = 4 (REFERENCES.md 4.3): one velocity solve, exact up to elements and
regularisation."""

import numpy as np

from fenics_forming import FixedVelocity, NewtonSettings, laws, meshing, solve_flow

from .measuring import Case, Trial

EXACT = 1.7562 * 200 / np.sqrt(3)       # MPa
LEVELS = ((0.08, 0.5), (0.04, 0.25), (0.02, 0.125), (0.01, 0.0625))      # at the corner, growth per unit of distance
UNIFORM = (0.2, 0.1, 0.05, 0.025)


def held(mesh, axis, at, *velocity):
    facets = meshing.boundary_facets(mesh, lambda x: np.isclose(x[axis], at))
    return [FixedVelocity(facets, i, v) for i, v in enumerate(velocity) if v is not None]


def block(size, growth=None, half=2.0, **numbers):
    """Error of the mean pressure on a quarter of a block of height 1."""
    outline = [(0, 0), (half, 0), (half, 0.5), (0, 0.5)]
    mesh = meshing.polygon(outline, size) if growth is None else \
        meshing.polygon(outline, 0.3, corners=[(half, 0.5)], corner_size=size, growth=growth)
    fixed = held(mesh, 0, 0, 0, None) + held(mesh, 1, 0, None, 0) + held(mesh, 1, 0.5, 0, -1)
    flow = solve_flow(mesh, kinematics="plane_strain", flow_stress=laws.Constant(value=100.0), fixed=fixed,
                      characteristic_rate=2.0, settings=NewtonSettings(**numbers))
    return flow.plastic_power / half / EXACT - 1, flow.workpiece.space.dofmap.index_map.size_global, 1


def trials():
    made = [Trial("elements fine at the corner", f"{size:g}", lambda s=size, g=growth: block(s, g), size == 0.02)
            for size, growth in LEVELS]
    made += [Trial("elements of one size", f"{size:g}", lambda s=size: block(s), size == 0.05) for size in UNIFORM]
    return made + [Trial(f"regularisation {value:g}", f"{size:g}", lambda s=size, g=growth, v=value: block(
        s, g, regularisation=v)) for value in (1.5e-2, 1.5e-4) for size, growth in LEVELS[:3]]


CASE = Case("platens", "Block between rough platens, w/h = 4: limit load", "the pressure", "unknowns", trials,
            "First order in the element size: the exact velocities jump. Regularisations of a tenth and of ten times the "
            "default change neither error nor time by more than a few per cent.")
