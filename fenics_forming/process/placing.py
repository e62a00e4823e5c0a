"""A body on a mesh: its mirror planes, the facets that tools may touch, and the forms and solver of just what is named."""

from __future__ import annotations

import numpy as np
from dolfinx.mesh import Mesh

from ..errors import MeshError
from ..physics.conditions import FixedVelocity, facet_nodes
from ..physics.contact.facets import ContactFacets
from ..physics.contact.rigid import KnownTool, RigidContact
from ..physics.facets import boundary_facets, exterior_facets
from ..physics.kinematics import KINDS
from ..physics.nodes import Nodes
from ..physics.parallel import total
from ..physics.settings import NewtonSettings
from ..physics.workpiece import Workpiece
from ..scene import Scene
from .body import FlowingBody
from .moving import mass_of, velocity_of
from .volume import FreeSurface


def flowing_body(scene: Scene, mesh: Mesh, tools: list[KnownTool], mirrors: dict[int, float]) -> FlowingBody:
    """The workpiece of the scene on ``mesh``, between ``tools``, held on its mirror planes."""
    nodes, kinematics = Nodes(mesh), KINDS[scene.geometry]
    fixed, candidates = _boundary(nodes, mirrors, scene.axes)
    settings = settings_of(scene)
    contact = RigidContact(ContactFacets(nodes, kinematics, candidates), tools,
                           slip_regularisation=settings.slip_regularisation) if tools else None
    material = scene.materials[scene.workpiece.material]
    workpiece = Workpiece(nodes, kinematics=kinematics, contact=contact, fixed=fixed, settings=settings,
                          flow_stress=material.flow_stress, mass=mass_of(scene))
    heat = None
    if scene.computes_heat:
        from .heat.building import body_heat
        heat = body_heat(scene, nodes, kinematics, candidates, tools, workpiece)
    return FlowingBody(workpiece, boundary=nodes_of(nodes, candidates), working_direction=working_direction(scene),
                       heat=heat, free_surface=FreeSurface.of_mesh(nodes, kinematics, mirrors),
                       drives={t.name: t.drive for t in tools if t.drive is not None},
                       temperature=scene.workpiece.temperature, damage=material.damage,
                       initial_velocity=velocity_of(scene, nodes))


def settings_of(scene: Scene) -> NewtonSettings:
    """The numerical parameters of the scene."""
    return NewtonSettings(**{name: getattr(scene.solver, name) for name in type(scene.solver).model_fields})


def nodes_of(nodes: Nodes, facets: np.ndarray) -> np.ndarray:
    """All nodes of this rank on the facets of any rank: where one moves, its copies move along. Collective."""
    mark = np.zeros(nodes.count)
    mark[facet_nodes(nodes, facets)] = 1.0
    return np.flatnonzero(nodes.sum_at_all(mark) > 0)


def mirror_planes(scene: Scene, mesh: Mesh) -> dict[int, float]:
    """Axis → coordinate of the mirror planes and, in axisymmetry, the axis; of the body as it is at the start."""
    low, high = Nodes(mesh).extents()
    planes = {scene.axes.index(a): float(low[scene.axes.index(a)]) for a in scene.workpiece.symmetry}
    if scene.geometry == "axisymmetric" and low[0] <= 1e-9 * (high - low).max():
        planes[0] = 0.0
    return planes


def free_facets(nodes: Nodes, mirrors: dict[int, float], axes) -> np.ndarray:
    """Facets of the surface that lie on no mirror plane."""
    return _boundary(nodes, mirrors, axes)[1]


def _boundary(nodes: Nodes, mirrors: dict[int, float], axes) -> tuple[list[FixedVelocity], np.ndarray]:
    """Conditions on the mirror planes, and the facets that are left for tools to touch."""
    size = float(np.ptp(nodes.extents(), axis=0).max())
    on_plane = [(axis, boundary_facets(nodes.mesh, lambda x, a=axis, v=value: np.abs(x[a] - v) < 1e-8 * size))
                for axis, value in mirrors.items()]
    for axis, facets in on_plane:
        if total(nodes.comm, len(facets)) == 0:
            raise MeshError(f"the body has no flat low face on the axis {axes[axis]}, which is to be its mirror plane")
    taken = np.concatenate([f for _, f in on_plane]) if on_plane else np.empty(0, np.int32)
    return [FixedVelocity(f, axis) for axis, f in on_plane], np.setdiff1d(exterior_facets(nodes.mesh), taken)


def working_direction(scene: Scene) -> np.ndarray:
    """Unit vector (dim,) along which the tool that counts works; where it turns, or none moves, the last axis."""
    tool = scene.counting_tool
    direction = scene.tools[tool].drive.direction if tool is not None else None
    return np.eye(scene.dimension)[-1] if direction is None else np.asarray(direction, float)
