"""The temperature of a tool as a field on a mesh of its own, in the frame that moves with the tool."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ...laws.heat_exchange import CoupledExchange
from ...physics.facets import exterior_facets
from ...physics.kinematics import KINDS
from ...physics.nodes import Nodes
from ...physics.solid_mesh import facing_points, solid_mesh
from ...physics.surface import facet_sides
from ...physics.thermal.field import HeatField
from ...physics.thermal.pairing import TouchedSides, conductances
from ...scene import Scene
from ...scene.heat import tool_material

# Of the element size of the workpiece, at the contact, where the scene gives no mesh_size: in a tenth of a second heat goes
# a millimetre deep into a die, and a layer of elements that is thicker takes up too much. In space that is too many.
FINE = {2: 0.1, 3: 0.25}


@dataclass(frozen=True)
class Touch:
    """Points of a workpiece that touch a tool: places in its frame (p, dim), mm, strength (p,), mW/K, the vertices of the
    workpiece (p, dim), by their numbers of all ranks, with their hats (p, dim), and the length of their side (p,), mm."""

    places: np.ndarray
    strength: np.ndarray
    vertices: np.ndarray
    hats: np.ndarray
    side: np.ndarray

    def gathered(self, comm: MPI.Comm) -> Touch | None:
        """Those of all ranks on rank 0, None elsewhere. Collective."""
        parts = comm.gather(tuple(vars(self).values()), 0)
        return None if parts is None else Touch(*(np.concatenate(column) for column in zip(*parts, strict=True)))


class ToolHeat:
    """Capacities and conductances of a tool; its surface is insulated where no workpiece touches it.

    Parameters
    ----------
    nodes : its mesh, as it is at the start of the run · law : what the scene says of it

    Attributes
    ----------
    count : of its vertices · finest : side of its surface, mm
    network : capacities, pairs and conductances on rank 0, None elsewhere
    """

    def __init__(self, nodes: Nodes, kinematics, law: CoupledExchange, *, conductivity: float, volumetric_capacity: float):
        self.nodes, self.law = nodes, law
        self.field = HeatField(nodes, kinematics, conductivity=conductivity, volumetric_capacity=volumetric_capacity)
        self.network = self.field.network()
        self.count = int(nodes.scalar_space.dofmap.index_map.size_global)
        x = self.field.gathered(nodes.x)
        sides = facet_sides(nodes, exterior_facets(nodes.mesh))[:, : nodes.dim]
        parts = nodes.comm.gather(self.field.vertex_numbers[sides], 0)
        self._sides = None if parts is None else TouchedSides(x, np.concatenate(parts))
        self.finest = nodes.comm.bcast(None if self._sides is None else self._sides.finest, 0)

    def first(self) -> np.ndarray:
        """Temperatures of the vertices (v,) at the start, degC."""
        return np.full(self.count, self.law.temperature)

    def pairs(self, touch: Touch) -> tuple[np.ndarray, np.ndarray]:
        """Pairs (m, 2) of a vertex of the workpiece and one of the tool, and their conductances (m,), mW/K; on rank 0."""
        if not len(touch.strength):
            return np.empty((0, 2), int), np.empty(0)
        return conductances((touch.vertices, touch.hats), self._sides.find(touch.places), touch.strength)

    def nodal(self, temperature: np.ndarray) -> np.ndarray:
        """Temperatures of the vertices (v,) at the local nodes (nodes,), degC. Collective."""
        return self.field.scattered(temperature if self.nodes.comm.rank == 0 else None)


@dataclass(frozen=True)
class Waiting:
    """Where a tool is in its own step: steps and time, s, since heat was last conducted inside it, and the heat that its
    vertices have been given since, (v,) mJ."""

    steps: int
    time: float
    held: np.ndarray

    @classmethod
    def none(cls, count: int) -> Waiting:
        """Heat has just been conducted."""
        return cls(0, 0.0, np.zeros(count))

    def memory(self) -> list:
        """As JSON can hold it."""
        return [self.steps, self.time, self.held.tolist()]


def tool_heat(scene: Scene, known, comm) -> ToolHeat:
    """The temperature field of a tool of a scene (``KnownTool``): on the mesh on which it deforms, where it does; else it
    is meshed for that, fine where it faces the workpiece. Collective.

    Raises
    ------
    MeshError
        if it cannot be meshed.
    """
    name, sizes = known.name, [body.mesh_size for body in scene.workpieces.values() if body.mesh_size is not None]
    tool, material = scene.tools[name], scene.materials[tool_material(scene, name)]
    made = lambda nodes: ToolHeat(nodes, KINDS[scene.geometry], tool.heat_exchange, conductivity=material.conductivity,  # noqa: E731
                                  volumetric_capacity=material.density * material.specific_heat)
    if known.deformation is not None and known.deformation.tool is not None:
        return made(known.deformation.tool.body.nodes)
    near = facing_points(scene, name, {name: tool})[name]
    size = tool.mesh_size
    contact, far = (None, None) if size is None else (size.contact, size.far)
    if contact is None and sizes:
        contact = FINE[scene.dimension] * min(sizes)
    mirrors = [scene.axes.index(a) for a in tool.symmetry] + [0] * (scene.geometry == "axisymmetric")
    mesh = solid_mesh(tool.shape, scene.dimension, contact=contact, far=far, near=near, mirrors=mirrors, comm=comm)
    return made(Nodes(mesh))
