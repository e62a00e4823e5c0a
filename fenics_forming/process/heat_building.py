"""From a scene to the heat problem of its workpiece."""

from __future__ import annotations

from ..laws.heat_exchange import effusivity
from ..physics.contact.facets import ContactFacets
from ..physics.thermal.field import HeatField
from ..scene import Scene
from ..scene.heat import missing, tool_material
from .heat_surface import ToolExchange
from .heating import BodyHeat
from .tool_heat import tool_heat


def body_heat(scene: Scene, nodes, kinematics, surface, tools, workpiece=None) -> BodyHeat:
    """The heat of the workpiece of a scene on its present mesh.

    surface : facets of it that lie on no mirror plane · tools : the ``KnownTool`` s; those that are coupled get their mesh
    here, once, and keep it · workpiece : whose flow makes heat, or None
    """
    body = scene.workpiece
    material = scene.materials[body.material]
    field = HeatField(nodes, kinematics, conductivity=material.conductivity,
                      volumetric_capacity=material.density * material.specific_heat)
    exchanges = {name: ToolExchange(tool.heat_exchange, _effusivity(scene, name))
                 for name, tool in scene.tools.items() if tool.heat_exchange.acts}
    for tool in tools:
        if scene.tools[tool.name].heat_exchange.kind == "coupled" and tool.heat is None:
            tool.heat = tool_heat(scene, tool, nodes.comm)
    contact = None if workpiece is None else workpiece.contact
    facets = ContactFacets(nodes, kinematics, surface) if contact is None else contact.facets
    return BodyHeat(field, facets, exchanges=exchanges, effusivity=effusivity(material), air=body.air,
                    tool_heats={tool.name: tool.heat for tool in tools if tool.heat is not None},
                    workpiece=workpiece, plastic_fraction=None if workpiece is None else material.plastic_heat_fraction)


def _effusivity(scene: Scene, tool: str) -> float | None:
    """That of a tool, where its material is known and complete."""
    material = scene.materials.get(tool_material(scene, tool))
    return None if material is None or missing(material) else effusivity(material)
