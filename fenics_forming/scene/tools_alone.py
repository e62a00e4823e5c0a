"""Scenes in which nothing is formed: deformable tools under loads, interference and held displacements of their own."""

from ..errors import SceneError
from .solid_checks import deforming_problems, solids_of, tool_point_problems


def tools_alone_problems(scene):
    """SceneErrors of a scene without workpieces."""
    for name, tool in scene.tools.items():
        if not tool.has_body:
            yield SceneError("is rigid, and nothing is formed; give it a 'material' or 'parts', or leave it out",
                             key=f"tools.{name}", got=name, allowed="a tool that deforms")
        if tool.drive is not None:
            yield SceneError("moves the tool, and nothing is formed; expected no drive; 'held' displaces a face",
                             key=f"tools.{name}.drive", got=tool.drive, allowed="nothing")
    if scene.stop is not None:
        yield SceneError("belongs to a scene in which something is formed; tools alone end with their full loads",
                         key="stop", got=scene.stop, allowed="nothing")
    if scene.flow_lines:
        yield SceneError("follow material that flows; there is no workpiece", key="flow_lines", allowed="nothing")
    yield from deforming_problems(scene, [name for name, tool in scene.tools.items() if tool.has_body])
    yield from tool_point_problems(scene)


def tools_alone_warnings(scene):
    """Sentences about what has no effect where nothing is formed."""
    found = []
    used = {solid.material for *_, solid in solids_of(scene)}
    for name in scene.materials:
        if name not in used:
            found.append(f"materials.{name}: no body is made of it")
    for name, tool in scene.tools.items():
        if tool.says("friction"):
            found.append(f"tools.{name}.friction: has no effect, nothing is formed; parts have that of their [[contacts]]")
    return found
