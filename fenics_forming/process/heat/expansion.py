"""Tools that deform and whose temperatures are computed expand with these; both live on the same mesh."""

from __future__ import annotations


def expand(body, state) -> None:
    """Take the temperatures of the tools over as thermal strains, and their surfaces to where they are without contact now.
    Collective.

    A tool has the shape that the scene gives it at its temperature of the start. What contact does to it comes on top: in
    its equilibrium :math:`K_s(u-u^*)=-f` the displacements without contact :math:`u^*` follow the temperature.

    Parameters
    ----------
    body : ``FlowingBody`` · state : ``heating.HeatState``
    """
    for deformation in body.deformations:
        if expands(deformation.known):
            heat = deformation.known.heat
            deformation.expand(heat.nodal(state.tools[deformation.name]), heat.law.temperature)


def expands(known) -> bool:
    """Whether a tool (``KnownTool``) has temperatures, deforms, and has an expansion in all of its material."""
    tool = None if known.deformation is None else known.deformation.tool
    return tool is not None and known.heat is not None and all(law.expansion for law, _ in tool.body.parts)
