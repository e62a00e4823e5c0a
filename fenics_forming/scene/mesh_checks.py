"""Whether the mesh that a scene asks for can be made: sizes, refinement, number of unknowns."""

import numpy as np

from ..errors import SceneError

MOST_DOFS = {2: 5e6, 3: 2e6}
"""More unknowns than these are refused: a direct solver would need more memory than a large machine has."""


def mesh_problems(scene):
    """SceneErrors of meshes that cannot be meant or made."""
    for name, body in scene.workpieces.items():
        key = f"workpieces.{name}"
        yield from _order_problems(key, body)
        if body.shape.file is None:
            yield from _mesh_size_problems(scene, key, body)
            yield from _refine_problems(scene, key, body)


def mesh_warnings(scene):
    """Sentences about mesh sizes that have no effect or are probably not meant."""
    for name, body in scene.workpieces.items():
        for number, domain in enumerate(body.refine):
            if body.mesh_size is not None and domain.size >= body.mesh_size:
                yield f"workpieces.{name}.refine.{number}.size: has no effect, it is not below mesh_size"
        if body.remesh is not None and body.remesh.temperature is not None:
            yield f"workpieces.{name}.remesh.temperature: has no effect, temperatures are not computed in this run"
        if body.shape.file is None and body.mesh_size is not None:
            least = np.ptp(body.shape.bounds(), axis=0).min()
            if body.mesh_size > least:
                yield f"workpieces.{name}.mesh_size: is larger than the smallest extent of the body, {least:g} mm"


def estimated_dofs(dimension, measure, mesh_size):
    """Unknowns of a P2-P1 mesh of equilateral cells of size h: 10.4 A / h^2 in 2-D, 35 V / h^3 in 3-D.

    2-D: 2.31 A/h^2 triangles with 4.5 unknowns each; 3-D: 8 V/h^3 tetrahedra with 4.3 unknowns each.
    """
    return 10.4 * measure / mesh_size**2 if dimension == 2 else 35 * measure / mesh_size**3


def _order_problems(key, body):
    remesh = body.remesh
    if remesh is None or body.mesh_size is None:
        return
    if remesh.min_size is not None and remesh.min_size > body.mesh_size:
        sentence = f"{remesh.min_size:g} mm is larger than mesh_size {body.mesh_size:g} mm"
        yield SceneError(
            sentence, key=f"{key}.remesh.min_size", got=remesh.min_size, allowed=f"at most {body.mesh_size:g}"
        )


def _mesh_size_problems(scene, key, body):
    if body.mesh_size is None:
        return
    extent = float(np.ptp(body.shape.bounds(), axis=0).max())
    if body.mesh_size > extent:
        sentence = f"{body.mesh_size:g} mm is larger than the body, {extent:g} mm"
        yield SceneError(sentence, key=f"{key}.mesh_size", got=body.mesh_size, allowed=f"below {extent:g}")
        return
    yield from too_fine(scene.dimension, body.shape.volume_or_area(), body.mesh_size, f"{key}.mesh_size")


def _refine_problems(scene, key, body):
    whole = body.shape.volume_or_area()
    for number, domain in enumerate(body.refine):
        measure = min(whole, domain.measure_within(body.shape.bounds()))
        yield from too_fine(scene.dimension, measure, domain.size, f"{key}.refine.{number}.size")


def too_fine(dimension, measure, size, key):
    """A SceneError where a body of this area or volume needs more unknowns than `MOST_DOFS`."""
    dofs, most = estimated_dofs(dimension, measure, size), MOST_DOFS[dimension]
    if dofs > most:
        least = size * (dofs / most) ** (1 / dimension)
        sentence = (
            f"{size:g} mm is too fine: about {dofs:.2g} unknowns, more than {most:.0g}; expected at least {least:.2g} mm"
        )
        yield SceneError(sentence, key=key, got=size, allowed=f"at least {least:.2g}")
