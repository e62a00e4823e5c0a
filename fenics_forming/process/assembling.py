"""Several bodies on one mesh, ready to flow: mirror planes, contact with tools and with one another, laws of each."""

from __future__ import annotations

import numpy as np
from dolfinx.mesh import Mesh

from ..errors import MeshError
from ..physics.assembly import assembled_mesh
from ..physics.conditions import FixedVelocity
from ..physics.contact.facets import ContactFacets
from ..physics.contact.interfaces import Pair, side_length
from ..physics.contact.rigid import KnownTool, RigidContact
from ..physics.facets import exterior_facets
from ..physics.kinematics import KINDS
from ..physics.nodes import Nodes
from ..physics.parallel import highest, lowest, total
from ..physics.parts import DamageByRow, Parts
from ..physics.surface import Surface, facet_sides
from ..physics.workpiece import Workpiece
from ..scene import Scene
from ..scene.contacts import drawn_overlap
from .body import FlowingBody
from .moving import mass_of, velocity_of
from .placing import nodes_of, settings_of, working_direction
from .volume import FreeSurface

SAME = 1e-8       # of the size of the assembly: a node so near to a mirror plane is on it


def assemble(scene: Scene, tools: list[KnownTool], comm, saved):
    """The bodies of the scene on one mesh, the mesh size of each, mm, and their mirror planes; those of the checkpoint
    ``saved`` where there is one. Collective."""
    if saved is None:
        mesh, sizes, counts = assembled_mesh(scene, tools, comm)
        mirrors = mirror_planes_of(scene, Parts(Nodes(mesh), scene.workpieces, counts))
        return assembled_body(scene, mesh, tools, mirrors, counts, None), sizes, mirrors
    made = saved.scalars["bodies"]
    mirrors = {name: {int(a): v for a, v in planes.items()} for name, planes in saved.scalars["mirrors"].items()}
    body = assembled_body(scene, saved.mesh(comm), tools, mirrors, made["cells"], made["slaves"])
    return body, saved.scalars["mesh_size"], mirrors


def mirror_planes_of(scene: Scene, parts: Parts) -> dict[str, dict[int, float]]:
    """Body → axis → coordinate of its mirror planes and, in axisymmetry, the axis, as the bodies are at the start."""
    size = float(np.ptp(parts.nodes.extents(), axis=0).max())
    planes = {}
    for name, body in scene.workpieces.items():
        low = part_extents(parts, name)[0]
        planes[name] = {scene.axes.index(a): float(low[scene.axes.index(a)]) for a in body.symmetry}
        if scene.geometry == "axisymmetric" and low[0] <= 1e-9 * size:
            planes[name][0] = 0.0
    return planes


def part_extents(parts: Parts, name: str) -> np.ndarray:
    """Lowest and highest coordinates of one of the bodies, (2, dim), mm. Collective."""
    x = parts.nodes.x[parts.of_node == parts.names.index(name)]
    return np.array([lowest(parts.nodes.comm, x.min(axis=0, initial=np.inf)),
                     highest(parts.nodes.comm, x.max(axis=0, initial=-np.inf))])


def assembled_body(scene: Scene, mesh: Mesh, tools: list[KnownTool], mirrors: dict[str, dict[int, float]],
                   counts, slaves: dict[str, str] | None) -> FlowingBody:
    """The workpieces of the scene on ``mesh``, of which each has ``counts`` cells, between ``tools``.

    slaves : name of a contact → body whose surface holds its points, where that was decided before
    """
    nodes, kinematics = Nodes(mesh), KINDS[scene.geometry]
    parts = Parts(nodes, scene.workpieces, counts)
    free, fixed = boundary_of(parts, mirrors, scene.axes)
    candidates = np.sort(np.concatenate(list(free.values())))
    settings = settings_of(scene)
    contact = RigidContact(ContactFacets(nodes, kinematics, candidates), tools,
                           slip_regularisation=settings.slip_regularisation)
    materials = [scene.materials[body.material] for body in scene.workpieces.values()]
    workpiece = Workpiece(nodes, kinematics=kinematics, contact=contact, fixed=fixed, settings=settings, parts=parts,
                          flow_stress=[m.flow_stress for m in materials], pairs=_pairs(scene, nodes, free, slaves),
                          mass=mass_of(scene, parts))
    heat = None
    if scene.computes_heat:
        from .heat.building import heat_of_bodies
        slaves = {} if workpiece.interfaces is None else workpiece.interfaces.slaves
        heat = heat_of_bodies(scene, parts, kinematics, free, tools, slaves, workpiece)
    return FlowingBody(workpiece, boundary=nodes_of(nodes, candidates), working_direction=working_direction(scene),
                       heat=heat,
                       surfaces={name: _surface(parts, name, kinematics, mirrors[name]) for name in parts.names},
                       drives={t.name: t.drive for t in tools if t.drive is not None},
                       temperature=_temperature(scene, parts), damage=_damage(materials, parts),
                       initial_velocity=velocity_of(scene, nodes, parts))


def boundary_of(parts: Parts, mirrors, axes) -> tuple[dict[str, np.ndarray], list[FixedVelocity]]:
    """Exterior facets of each body that lie on none of its mirror planes, and the conditions on those that do."""
    nodes, free, fixed = parts.nodes, {}, []
    size, exterior = float(np.ptp(nodes.extents(), axis=0).max()), exterior_facets(nodes.mesh)
    for name in parts.names:
        own = parts.facets_of(name, exterior)
        x = nodes.x[facet_sides(nodes, own)]
        left = np.ones(len(own), bool)
        for axis, value in mirrors[name].items():
            on = (np.abs(x[..., axis] - value) < SAME * size).all(axis=1)
            if total(nodes.comm, int(on.sum())) == 0:
                raise MeshError(f"'{name}' has no flat low face on the axis {axes[axis]}, which is to be its mirror plane")
            fixed.append(FixedVelocity(own[on], axis))
            left &= ~on
        free[name] = own[left]
    return free, fixed


def finer_bodies(scene: Scene, nodes: Nodes, free: dict[str, np.ndarray]) -> dict[str, str]:
    """Contact of two workpieces → the one with the finer surface. Collective."""
    length = {name: side_length(nodes, facet_sides(nodes, facets)) for name, facets in free.items()}
    return {contact.name: min(contact.between, key=length.get) for contact in scene.contacts
            if set(contact.between) <= set(scene.workpieces)}


def _pairs(scene: Scene, nodes: Nodes, free: dict[str, np.ndarray], slaves) -> list[Pair]:
    """The contacts of the scene; the points lie on the finer of the two surfaces."""
    slaves, pairs = slaves or finer_bodies(scene, nodes, free), []
    for contact in scene.contacts:
        slave = slaves[contact.name]
        master = next(name for name in contact.between if name != slave)
        friction = contact.friction if contact.friction.law != "none" else None
        # what is drawn the mesh has already
        hidden = contact.interference and max(contact.interference - drawn_overlap(scene, contact), 0.0)
        pairs.append(Pair(contact.name, free[slave], free[master], friction, hidden, contact.element, slave,
                          contact.interference))
    return pairs


def _surface(parts: Parts, name: str, kinematics, mirrors) -> FreeSurface:
    nodes, cells = parts.nodes, parts.nodes.cells[parts.cells_of(name)]
    sides = facet_sides(nodes, parts.facets_of(name, exterior_facets(nodes.mesh)))
    return FreeSurface(Surface(sides, nodes.x, kinematics, nodes=nodes), nodes.x, cells, mirrors)


def _temperature(scene: Scene, parts: Parts) -> np.ndarray | None:
    """Temperature of the nodes (nodes,), degC, not a number where a body has none; None where no body has one."""
    given = [body.temperature for body in scene.workpieces.values()]
    if all(t is None for t in given):
        return None
    return parts.nodal([np.nan if t is None else t for t in given])


def _damage(materials, parts: Parts) -> DamageByRow | None:
    laws = [m.damage for m in materials]
    if all(law is None for law in laws):
        return None
    vertices = parts.nodes.vertices
    return DamageByRow(laws, np.broadcast_to(parts.of_cell[:, None], vertices.shape))
