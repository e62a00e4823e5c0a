"""From a scene to the heat problem of its workpieces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...laws.heat_exchange import effusivity
from ...physics.contact.facets import ContactFacets
from ...physics.surface import facet_sides
from ...physics.thermal.field import HeatField
from ...scene import Scene
from ...scene.heat import missing, tool_material
from .heating import BodyHeat
from .surface import ToolExchange
from .tool_field import tool_heat


@dataclass(frozen=True)
class AirOfBodies:
    """The air around several workpieces, node by node, (nodes,) each; the names of an ``Air``."""

    temperature: np.ndarray
    coefficient: np.ndarray
    emissivity: np.ndarray
    ways: list[str]


def body_heat(scene: Scene, nodes, kinematics, surface, tools, workpiece=None) -> BodyHeat:
    """The heat of the workpiece of a scene on its present mesh.

    surface : facets of it that lie on no mirror plane · tools : the ``KnownTool`` s; those that are coupled get their mesh
    here, once, and keep it · workpiece : whose flow makes heat, or None
    """
    body = scene.workpiece
    material = scene.materials[body.material]
    field = HeatField(nodes, kinematics, conductivity=material.conductivity,
                      volumetric_capacity=material.density * material.specific_heat)
    return BodyHeat(field, _facets(nodes, kinematics, surface, workpiece), effusivity=effusivity(material), air=body.air,
                    plastic_fraction=None if workpiece is None else material.plastic_heat_fraction or None,
                    **_with_tools(scene, nodes, tools, workpiece))


def heat_of_bodies(scene: Scene, parts, kinematics, free: dict[str, np.ndarray], tools, slaves: dict[str, str],
                   workpiece=None) -> BodyHeat:
    """The heat of several workpieces in one mesh.

    parts : the ``Parts`` · free : body → facets of it that lie on no mirror plane · slaves : contact → its finer body
    """
    from .meeting import Meeting

    nodes, bodies = parts.nodes, scene.workpieces
    materials = [scene.materials[body.material] for body in bodies.values()]
    of_cells = lambda values: np.asarray(values, float)[parts.of_all_cells]  # noqa: E731
    field = HeatField(nodes, kinematics, conductivity=of_cells([m.conductivity for m in materials]),
                      volumetric_capacity=of_cells([m.density * m.specific_heat for m in materials]))
    uptake = {name: effusivity(material) for name, material in zip(bodies, materials, strict=True)}
    meetings = []
    for contact in scene.contacts:
        if contact.name not in slaves:      # of parts of a tool
            continue
        slave = slaves[contact.name]
        master = next(name for name in contact.between if name != slave)
        share = uptake[slave] / (uptake[slave] + uptake[master])
        meetings.append(Meeting(contact.name, facet_sides(nodes, free[slave]), facet_sides(nodes, free[master]),
                                (slave, master), 1.0 if slave == contact.between[0] else -1.0, contact.conductance,
                                (share, 1.0 - share)))
    fractions = [m.plastic_heat_fraction or 0.0 for m in materials]
    surface = np.sort(np.concatenate(list(free.values())))
    return BodyHeat(field, _facets(nodes, kinematics, surface, workpiece), effusivity=parts.nodal(list(uptake.values())),
                    air=_air(parts, [body.air for body in bodies.values()]), parts=parts, meetings=tuple(meetings),
                    plastic_fraction=of_cells(fractions) if workpiece is not None and any(fractions) else None,
                    **_with_tools(scene, nodes, tools, workpiece))


def _air(parts, airs) -> AirOfBodies | None:
    ways = [way for way in ("air", "radiation") if any(air is not None and way in air.ways for air in airs)]
    if not ways:
        return None
    value = lambda name: parts.nodal([0.0 if air is None else getattr(air, name) or 0.0 for air in airs])  # noqa: E731
    return AirOfBodies(value("temperature"), value("coefficient"), value("emissivity"), ways)


def _facets(nodes, kinematics, surface, workpiece) -> ContactFacets:
    """Those that contact has already, where there is contact."""
    contact = None if workpiece is None else workpiece.contact
    return ContactFacets(nodes, kinematics, surface) if contact is None else contact.facets


def _with_tools(scene: Scene, nodes, tools, workpiece) -> dict:
    """What the heat problem is told of tools, and of the workpiece that flows."""
    exchanges = {name: ToolExchange(tool.heat_exchange, _effusivity(scene, name))
                 for name, tool in scene.tools.items() if tool.heat_exchange.acts}
    for tool in tools:
        if scene.tools[tool.name].heat_exchange.kind == "coupled" and tool.heat is None:
            tool.heat = tool_heat(scene, tool, nodes.comm)
    return {"exchanges": exchanges, "workpiece": workpiece,
            "tool_heats": {tool.name: tool.heat for tool in tools if tool.heat is not None}}


def _effusivity(scene: Scene, tool: str) -> float | None:
    """That of a tool, where its material is known and complete."""
    material = scene.materials.get(tool_material(scene, tool))
    return None if material is None or missing(material) else effusivity(material)
