"""Whether tools that deform with the workpiece, and press frames that yield, make sense in a scene."""

from ..errors import SceneError
from .solid_checks import deforming_problems, solids_of


def tool_mode_problems(scene):
    """SceneErrors of tools that deform while something is formed, and of their steps."""
    deforming = scene.deforming_tools
    yield from deforming_problems(scene, deforming)
    for name in deforming:
        tool = scene.tools[name]
        if not any(solid.held or solid.springs for solid in (tool, *tool.parts.values())):
            sentence = "is missing; the tool deforms, since its material has elastic constants, and nothing holds it; " \
                       "name the faces where its drive takes hold, or say process.tool_deformation = 'rigid'"
            yield SceneError(sentence, key=f"tools.{name}.held", allowed="a table such as { z_high = 'z' }")
        for key, solid in ((f"tools.{name}", tool), *((f"tools.{name}.parts.{n}", part) for n, part in tool.parts.items())):
            if set(solid.held.get("surface", ())) == set(scene.axes):
                sentence = "holds all of the surface on all axes; nothing of it is left that could deform"
                yield SceneError(sentence, key=f"{key}.held.surface", got=list(solid.held["surface"]),
                                 allowed="faces where the drive takes hold")
        yield from mirror_problems(scene, name)
    given = scene.process.tool_deformation
    for name in scene.yielding_tools if given in ("separate", "coupled") else ():
        if sentence := _must_be_iterated(name, scene.tools[name].drive, given):
            yield SceneError(sentence, key="process.tool_deformation", got=given, allowed="'iterated' or 'stress_only'")
    if scene.process.says("tool_deformation") and given != "rigid" and not scene.yielding_tools:
        sentence = f"'{given}', but no tool deforms; give one a 'material' with 'young' and 'poisson', or its drive a " \
                   "'stiffness'"
        yield SceneError(sentence, key="process.tool_deformation", got=given, allowed="a tool that deforms")
    if given == "rigid":
        for name, tool in scene.tools.items():
            if tool.drive is not None and tool.drive.frame_stiffness is not None:
                yield SceneError("yields, but process.tool_deformation is 'rigid'; leave one of them out",
                                 key=f"tools.{name}.drive.stiffness", got=tool.drive.stiffness)
    for key in ("tool_every", "tool_step"):
        if scene.steps.says(key) and not scene.yielding_tools and given != "rigid":
            yield SceneError("is the step of tools that deform, and no tool does", key=f"steps.{key}",
                             got=getattr(scene.steps, key), allowed="a tool that deforms")
    if scene.process.says("tool_guard") and given != "coupled":
        yield SceneError("guards the mode 'coupled' only", key="process.tool_guard", got=scene.process.tool_guard,
                         allowed="process.tool_deformation = 'coupled'")


def _must_be_iterated(name, drive, given):
    """Why a tool with this drive cannot be solved after the workpiece, in the mode ``given``; None where it can."""
    if drive is None:
        return None
    if drive.force_limit is not None:
        return f"'{given}' solves the tool '{name}' after its press, whose force limit makes the motion part of the solve"
    if getattr(drive, "is_free", False):
        return f"'{given}' solves the tool '{name}' after the body that turns it, so that the turn is part of the solve"
    if given == "coupled" and drive.rotation_centre is not None:
        return f"'coupled' lets the surface of '{name}' go on deforming as it did, but it turns, and other places come " \
               "under load"
    return None


def mirror_problems(scene, name):
    """A body is cut by its mirror planes; a tool that stands across or on one of them must be cut there too."""
    tool = scene.tools[name]
    shapes = [solid.shape for where, _, _, solid in solids_of(scene) if where == name]
    if any(shape.file is not None or not hasattr(shape, "bounds") for shape in shapes):
        return
    for body, part in scene.workpieces.items():
        if part.shape.file is not None:
            continue
        for axis in part.symmetry:
            k = scene.axes.index(axis)
            plane, low = part.shape.bounds()[0][k], min(shape.bounds()[0][k] for shape in shapes)
            size = max(shape.bounds()[1][k] for shape in shapes) - low
            if low <= plane + 1e-6 * size and axis not in tool.symmetry:
                sentence = f"does not name '{axis}', on which '{body}' has a mirror plane that the tool reaches; a tool " \
                           "that deforms must be cut there too"
                yield SceneError(sentence, key=f"tools.{name}.symmetry", got=list(tool.symmetry), allowed=[axis])


def tool_mode_warnings(scene):
    """Sentences on choices that change the results of tools that deform, or have no effect."""
    names = scene.yielding_tools
    mode, found = scene.process.tool_deformation, []
    if not names:
        given = (key for key in ("tool_every", "tool_step") if scene.steps.says(key))
        return [f"steps.{key}: has no effect, no tool deforms" for key in given]
    if mode in ("iterated", "stress_only"):
        found += [f"steps.{key}: has no effect in the mode '{mode}', in which the tools are solved with every step"
                  for key in ("tool_every", "tool_step") if scene.steps.says(key)]
    if mode == "stress_only":
        found.append("process.tool_deformation: 'stress_only' leaves the deflection of the tools out of the shape of the "
                     "workpiece")
    if mode == "separate":
        found.append("process.tool_deformation: 'separate' puts the surface of the workpiece onto the deformed tools, "
                     "which makes volume; the share is in the volume ledger")
    return found
