"""Scenes in which nothing is formed: deformable tools under loads, interference and held displacements of their own."""

from ..errors import SceneError
from .contacts import part_warnings
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
        if tool.heat_exchange.kind != "none":
            yield SceneError("is with a workpiece, and there is none; leave it out", key=f"tools.{name}.heat_exchange",
                             got=tool.heat_exchange, allowed="nothing")
    if scene.stop is not None:
        yield SceneError("belongs to a scene in which something is formed; tools alone end with their full loads",
                         key="stop", got=scene.stop, allowed="nothing")
    for key in sorted(scene.process.model_fields_set):
        yield SceneError("belongs to a scene in which something is formed; leave it out", key=f"process.{key}",
                         got=getattr(scene.process, key), allowed="nothing")
    for key in sorted(scene.steps.model_fields_set - {"loads"}) if scene.steps is not None else ():
        yield SceneError("belongs to a scene in which something is formed; the steps of tools alone are 'loads', a number "
                         "or a list of load factors", key=f"steps.{key}", got=getattr(scene.steps, key), allowed="loads")
    if scene.output.strokes:
        yield SceneError("belong to a tool that moves; leave them out", key="output.strokes", got=scene.output.strokes)
    if scene.flow_lines:
        yield SceneError("follow material that flows; there is no workpiece", key="flow_lines", allowed="nothing")
    yield from deforming_problems(scene, [name for name, tool in scene.tools.items() if tool.has_body])
    yield from tool_point_problems(scene)


def tools_alone_warnings(scene):
    """Sentences about what has no effect where nothing is formed."""
    found = [*part_warnings(scene)]
    used = {solid.material for *_, solid in solids_of(scene)}
    for name in scene.materials:
        if name not in used:
            found.append(f"materials.{name}: no body is made of it")
    for name, tool in scene.tools.items():
        if tool.says("friction"):
            found.append(f"tools.{name}.friction: has no effect, nothing is formed; parts have that of their [[contacts]]")
    return found
