"""A tool of a scene as a body that deforms: meshed, held and loaded, with the contacts between its parts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from ...errors import MeshError, SceneError
from ...physics.assembly import side_by_side
from ...physics.bodies import automatic_size
from ...physics.contact.bodies import FACING
from ...physics.contact.capture import CapturingSurface
from ...physics.contact.interfaces import side_length
from ...physics.nodes import Nodes
from ...physics.parts import Parts
from ...physics.solid_mesh import facing_points, solid_mesh
from ...physics.surface import facet_sides
from ...physics.tool_body import (
    AssembledSolver,
    ElasticSolver,
    FixedDisplacement,
    PartContact,
    PlasticSolver,
    Pressure,
    Springs,
    ToolBody,
    ToolSettings,
    Traction,
    solver_of,
)
from ...scene import Scene
from .faces import ToolFaces

NEAR = 0.02      # of the size of the smaller part: surfaces that are nearer to one another at the start may touch


@dataclass(frozen=True)
class MeshedTool:
    """A tool that deforms.

    Attributes
    ----------
    name : of the tool · body : its mesh, material and supports · parts : which cells and nodes belong to which part
    faces : `ToolFaces` · surface : (f,) owned exterior facets that lie on no mirror plane and not on the axis
    facing : (k,) those of them that workpieces may touch, all in a scene without workpieces
    loads : pressures and tractions that the scene puts on it, at their full size
    contacts : `PartContact` of its parts, ``contact_names`` theirs; empty of a tool in one piece
    """

    name: str
    body: ToolBody
    parts: Parts
    faces: ToolFaces
    surface: np.ndarray
    facing: np.ndarray
    loads: tuple = ()
    contacts: tuple[PartContact, ...] = ()
    contact_names: tuple[str, ...] = field(default=())

    @property
    def mirrors(self) -> dict[int, float]:
        """Axis → coordinate of the mirror planes and, in axisymmetry, the axis."""
        return self.faces.mirrors

    def solver(self, settings: ToolSettings = ToolSettings(), **numbers) -> ElasticSolver | PlasticSolver | AssembledSolver:
        """The solver that it needs: with contact only if it has parts, with a plastic state only if one of them yields."""
        if self.contacts:
            return AssembledSolver(self.body, self.contacts, settings, **numbers)
        return solver_of(self.body, settings)


def tool_body(scene: Scene, name: str, comm=MPI.COMM_WORLD) -> MeshedTool:
    """Mesh a tool of the scene, fine where it faces workpieces, loads and other parts, and hold it. Collective.

    Raises
    ------
    MeshError, SceneError
        if it cannot be meshed, or has not the faces that are named.
    """
    tool, dim = scene.tools[name], scene.dimension
    solids = tool.solids(name)
    mesh, counts = side_by_side(_meshes(scene, name, solids, comm), dim, comm)
    nodes = Nodes(mesh)
    parts = Parts(nodes, solids, counts)
    faces = ToolFaces(nodes, parts, solids, scene.axes, mirrors=tool.symmetry, on_axis=scene.geometry == "axisymmetric")
    laws = {part: scene.materials[solid.material].elasticity for part, solid in solids.items()}
    kinematics = tool.stress_state if scene.geometry == "plane_strain" else scene.geometry
    held, springs, loads = _supports_and_loads(scene, name, solids, faces)
    body = ToolBody(nodes, kinematics=kinematics, held=held, springs=springs,
                    material=[(law, parts.local_cells_of(part)) for part, law in laws.items()])
    surface = np.sort(np.concatenate([faces.surface(part) for part in solids]))
    between = [c for c in scene.contacts if set(c.between) <= set(solids)]
    return MeshedTool(name, body, parts, faces, surface, _facing(scene, name, nodes, surface, faces), loads,
                      tuple(_part_contact(c, nodes, faces) for c in between), tuple(c.name for c in between))


def _meshes(scene: Scene, name: str, solids, comm) -> list:
    tool, dim = scene.tools[name], scene.dimension
    axes = [scene.axes.index(a) for a in tool.symmetry] + [0] * (scene.geometry == "axisymmetric")
    near, meshes = facing_points(scene, name, solids), []
    for part, solid in solids.items():
        size = solid.mesh_size
        contact, far = (None, None) if size is None else (size.contact, size.far)
        if size is None and scene.workpieces and solid.shape.file is None:
            contact = _workpiece_size(scene)
        try:
            meshes.append(solid_mesh(solid.shape, dim, contact=contact, far=far, near=near[part], mirrors=axes, comm=comm))
        except MeshError as error:
            raise MeshError(f"tool '{name}', '{part}': {error}") from error
    return meshes


def _workpiece_size(scene: Scene) -> float | None:
    """The finest mesh size of the workpieces, mm, None if their shapes do not tell it."""
    sizes = [w.mesh_size or (automatic_size(w.shape.volume_or_area(), scene.dimension) if w.shape.file is None else None)
             for w in scene.workpieces.values()]
    return min((s for s in sizes if s is not None), default=None)


def _supports_and_loads(scene: Scene, name: str, solids, faces: ToolFaces):
    """Held displacements, springs and loads of the tool as a whole and of its parts."""
    tool, axes = scene.tools[name], scene.axes
    held = [FixedDisplacement(faces.on_mirror(axis), axis) for axis in faces.mirrors]
    springs, loads = [], []
    owners = [(tool, None, f"tools.{name}")]
    if tool.parts:
        owners += [(solid, part, f"tools.{name}.parts.{part}") for part, solid in solids.items()]
    for solid, part, key in owners:
        for face, shifts in solid.held.items():
            facets = faces.named(face, f"{key}.held.{face}", part)
            held += [FixedDisplacement(facets, axes.index(axis), shift) for axis, shift in shifts.items()]
        for face, bed in solid.springs.items():
            facets = faces.named(face, f"{key}.springs.{face}", part)
            springs.append(Springs(facets, bed.stiffness, None if bed.axis is None else axes.index(bed.axis)))
        for face, load in solid.loads.items():
            facets = faces.named(face, f"{key}.loads.{face}", part)
            loads += [Pressure(facets, load.pressure)] if load.pressure is not None else []
            loads += [Traction(facets, load.traction)] if load.traction is not None else []
    return held, springs, tuple(loads)


def _facing(scene: Scene, name: str, nodes: Nodes, surface: np.ndarray, faces: ToolFaces) -> np.ndarray:
    """Facets of the surface that workpieces may reach: within half the size of a workpiece of the nearest place; the whole
    mantle of a roll."""
    tool = scene.tools[name]
    if tool.rolls:
        return np.sort(faces.mantle(name))
    bounds = [w.shape.bounds() for w in scene.workpieces.values() if w.shape.file is None]
    if not bounds:
        return surface
    middle = nodes.x[facet_sides(nodes, surface)[:, : nodes.dim]].mean(axis=1)
    away = np.min([np.linalg.norm(np.maximum(np.maximum(low - middle, middle - high), 0.0), axis=1)
                   for low, high in bounds], axis=0)
    nearest = nodes.comm.allreduce(float(away.min(initial=np.inf)), MPI.MIN)
    return surface[away <= nearest + 0.5 * max(np.ptp(b, axis=0).max() for b in bounds)]


def _part_contact(contact, nodes: Nodes, faces: ToolFaces) -> PartContact:
    """The contact of two parts; points lie on the finer of the two surfaces, where it is near to the other one."""
    free = {part: faces.surface(part) for part in contact.between}
    near = {part: _near(nodes, free[part], free[other], faces, contact)
            for part, other in zip(contact.between, reversed(contact.between), strict=True)}
    length = {part: side_length(nodes, facet_sides(nodes, facets)) for part, facets in near.items()}
    slave = min(contact.between, key=length.get)
    master = next(part for part in contact.between if part != slave)
    interference = contact.interference if contact.says("interference") else None
    return PartContact(near[slave], free[master], interference=interference, element=contact.element,
                       friction=contact.friction, holder=slave)


def _near(nodes: Nodes, own: np.ndarray, other: np.ndarray, faces: ToolFaces, contact) -> np.ndarray:
    """Facets that face the other surface and have a node over it and near to it. Collective.

    Raises
    ------
    SceneError
        if there are none.
    """
    sides, master = facet_sides(nodes, own), facet_sides(nodes, other)
    numbers = np.asarray(nodes.mesh.geometry.index_map().local_to_global(master.ravel().astype(np.int32)))
    everywhere = lambda values: np.concatenate(nodes.comm.allgather(values))  # noqa: E731
    surface = CapturingSurface(everywhere(nodes.x[master]), everywhere(numbers.reshape(master.shape)))
    size = min(float(np.ptp(faces.extents_of(part), axis=0).max()) for part in contact.between)
    found = surface.capture(nodes.x[sides].reshape(-1, nodes.dim))
    edges = nodes.x[sides[:, 1: nodes.dim]] - nodes.x[sides[:, :1]]
    across = edges[:, 0, ::-1] * [1.0, -1.0] if nodes.dim == 2 else np.cross(edges[:, 0], edges[:, 1])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    opposed = np.einsum("ski,si->sk", found.normal.reshape(*sides.shape, nodes.dim), across).ravel() < FACING
    close = found.over & opposed & (np.abs(found.gap) < NEAR * size + contact.interference)
    chosen = own[close.reshape(sides.shape).any(axis=1)]
    if nodes.comm.allreduce(len(chosen)) == 0:
        names = " and ".join(f"'{part}'" for part in contact.between)
        raise SceneError(f"the surfaces of {names} are nowhere near to one another", key=f"contacts.{contact.name}")
    return chosen
