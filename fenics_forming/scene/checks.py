"""Cross checks of a scene, before any mesh: names, dimensions, steps and stop, capabilities. Places: `placement.py`."""

import math

from ..errors import SceneError
from ..laws.described import unknown_word
from .contacts import contact_problems, pair_problems, pair_warnings, part_warnings
from .cooling import cooling_problems
from .drive_checks import ratio_problems, stop_problems
from .heat import flowless_problems, heat_problems, heat_warnings, tool_material
from .initial_velocity import inertia_problems, moves_by_itself, undriven_problems
from .library import library_warnings
from .mesh_checks import mesh_problems, mesh_warnings
from .placement import placement_problems, placement_warnings
from .solid_checks import body_names, solid_problems, solids_of, tool_point_problems
from .tool_modes import tool_mode_problems, tool_mode_warnings
from .tools_alone import tools_alone_problems, tools_alone_warnings

_HEAT = ("conductivity", "specific_heat", "plastic_heat_fraction")
_ELASTIC = ("young", "poisson", "yield_stress", "hardening", "expansion")


def check(scene):
    """Whether the scene makes sense as a whole.

    Returns
    -------
    list of str : warnings, one sentence each, with the dotted key in front.

    Raises
    ------
    SceneError with one line (and one entry in `problems`) for everything that cannot be run.
    """
    problems = [*_name_problems(scene), *solid_problems(scene), *contact_problems(scene), *_dimension_problems(scene),
                *_file_problems(scene)]
    if scene.is_tools_alone and not problems:
        problems = [*tools_alone_problems(scene)]
        if not problems:
            return tools_alone_warnings(scene)
    if not problems:  # places can be compared only when every vector has the dimension of the scene
        problems = [*_law_problems(scene), *_step_problems(scene), *inertia_problems(scene)] if scene.process.flow else \
            [*flowless_problems(scene)]
        problems += [*mesh_problems(scene), *placement_problems(scene), *pair_problems(scene), *heat_problems(scene),
                     *cooling_problems(scene)]
        problems += [*_solver_problems(scene), *tool_point_problems(scene), *tool_mode_problems(scene)]
    if problems:
        raise SceneError.joined(problems)
    return [*_unused(scene), *mesh_warnings(scene), *placement_warnings(scene), *pair_warnings(scene),
            *part_warnings(scene), *library_warnings(scene), *heat_warnings(scene), *tool_mode_warnings(scene)]


def _name_problems(scene):
    if not scene.workpieces and not any(tool.has_body for tool in scene.tools.values()):
        yield SceneError("no workpieces are given; a run needs one at least", key="workpieces", allowed="one or more")
    for name, body in scene.workpieces.items():
        if body.material not in scene.materials:
            yield _unknown_name(f"workpieces.{name}.material", body.material, "material", scene.materials)
        for number, domain in enumerate(body.refine):
            if domain.tool_name is not None and domain.tool_name not in scene.tools:
                yield _unknown_name(f"workpieces.{name}.refine.{number}.tool", domain.tool_name, "tool", scene.tools)
    for group in ("points", "flow_lines"):
        for name, part in getattr(scene, group).items():
            bodies = scene.workpieces if group == "flow_lines" else body_names(scene)
            if part.body not in bodies:
                what = "workpiece" if bodies is scene.workpieces else "body"
                yield _unknown_name(f"{group}.{name}.body", part.body, what, bodies)
    yield from ratio_problems(scene)
    if scene.steps is not None and scene.steps.tool is not None and scene.steps.tool not in scene.tools:
        yield _unknown_name("steps.tool", scene.steps.tool, "tool", scene.tools)


def _unknown_name(key, name, what, names):
    return unknown_word(f"'{name}' is not the name of a {what}", name, names, key)


def _dimension_problems(scene):
    def compare(key, found):
        if found is not None and found != scene.dimension:
            sentence = (
                f"is {found}-dimensional; '{scene.geometry}' has the {scene.dimension} axes {', '.join(scene.axes)}"
            )
            yield SceneError(sentence, key=key, got=found, allowed=scene.dimension)

    for name, body in scene.workpieces.items():
        yield from compare(f"workpieces.{name}.shape", body.shape.dimension)
        yield from _symmetry_problems(scene, f"workpieces.{name}.symmetry", body.symmetry)
        for number, domain in enumerate(body.refine):
            yield from compare(f"workpieces.{name}.refine.{number}", domain.dimension)
    for name, tool in scene.tools.items():
        if tool.shape is not None:
            yield from compare(f"tools.{name}.shape", tool.shape.dimension)
        yield from _symmetry_problems(scene, f"tools.{name}.symmetry", tool.symmetry)
        if tool.drive is not None:
            yield from compare(f"tools.{name}.drive", tool.drive.dimension)
            if scene.geometry == "axisymmetric" and tool.drive.rotation_centre is not None:
                sentence = "turns the tool out of its axisymmetry; expected a drive without rotation"
                yield SceneError(
                    sentence, key=f"tools.{name}.drive", got=tool.drive, allowed="a drive without rotation"
                )
    for name, point in scene.points.items():
        yield from compare(f"points.{name}.at", len(point.at))
    for name, line in scene.flow_lines.items():
        yield from compare(f"flow_lines.{name}", len(line.from_))


def _symmetry_problems(scene, key, symmetry):
    allowed = [axis for axis in scene.axes if axis != "r"]
    for axis in symmetry:
        if axis == "r":
            yield SceneError("'r' needs no mirror plane: the body turns about the axis; allowed: z", key=key, got=axis)
        elif axis not in allowed:
            yield unknown_word(f"'{axis}' is not an axis of '{scene.geometry}'", axis, allowed, key)


def _file_problems(scene):
    for group in ("workpieces", "tools"):
        for name, part in getattr(scene, group).items():
            file = part.shape.file if part.shape is not None else None
            if file is not None and not file.is_file():
                sentence = f"the file '{file}' does not exist (paths are relative to the scene file)"
                yield SceneError(
                    sentence, key=f"{group}.{name}.shape.path", got=str(file), allowed="a file that exists"
                )


def _law_problems(scene):
    for name, body in scene.workpieces.items():
        law = scene.materials[body.material].flow_stress
        if law is None:
            sentence = f"is missing; the workpiece '{name}' is made of '{body.material}' and flows"
            yield SceneError(sentence, key=f"materials.{body.material}.flow_stress", allowed="a flow-stress law")
        elif law.depends_on_temperature and body.temperature is None:
            sentence = f"is missing; the law '{law.law}' of the material '{body.material}' depends on temperature"
            yield SceneError(
                sentence, key=f"workpieces.{name}.temperature", allowed="a temperature such as '1150 degC'"
            )


def _step_problems(scene):
    if scene.steps.loads is not None:
        yield SceneError("belongs to a scene of tools alone; expected 'stroke' or 'time' as the size of a step",
                         key="steps.loads", got=scene.steps.loads, allowed="stroke or time")
        return
    if not scene.driven_tools and moves_by_itself(scene):
        yield from undriven_problems(scene)
        return
    if not scene.driven_tools:
        what = "no tool moves" if scene.tools else "there is no tool"
        yield SceneError(f"{what}; expected at least one with a 'drive'", key="tools", allowed="a driven tool")
        return
    name = scene.counting_tool
    drive, steps, stop = scene.drive(name), scene.steps, scene.stop
    if drive is None or not drive.moves:
        sentence = (
            f"the tool '{name}' does not move, so that it has no stroke; allowed: {', '.join(scene.driven_tools)}"
        )
        yield SceneError(sentence, key="steps.tool", got=name, allowed=scene.driven_tools)
        return
    if drive.direction is None:
        needed = {"steps.stroke": steps.stroke, "stop.stroke": stop.stroke, "stop.height": stop.height}
        for key in (key for key, value in needed.items() if value is not None):
            sentence = f"the tool '{name}' only rotates and has no stroke; expected steps.time and stop.time"
            yield SceneError(sentence, key=key, got=needed[key], allowed="times")
        if scene.output.strokes:
            sentence = f"the tool '{name}' only rotates and has no stroke; expected no 'strokes'"
            yield SceneError(sentence, key="output.strokes", got=scene.output.strokes, allowed="nothing")
        return
    yield from _size_problems(scene, drive, name)


def _solver_problems(scene):
    if scene.solver.linear == "iterative" and scene.dimension == 2:
        sentence = "the iterative solver is for bodies in space; expected 'direct' or 'auto' in the plane"
        yield SceneError(sentence, key="solver.linear", got="iterative", allowed="direct, auto")


def _size_problems(scene, drive, name):
    steps, stop = scene.steps, scene.stop
    yield from stop_problems(scene, drive, name)
    for key in ("stroke", "time"):
        size, end = getattr(steps, key), getattr(stop, key)
        if size is not None and end is not None and size > end:
            sentence = f"{size:g} is larger than stop.{key} {end:g}; the run would end within its first step"
            yield SceneError(sentence, key=f"steps.{key}", got=size, allowed=f"at most {end:g}")
    only_stroke = stop.time is None and stop.force is None and stop.height is None
    if stop.stroke is not None and only_stroke and math.isinf(drive.time_of_travel(stop.stroke)):
        reach = drive.travel(1e30)
        sentence = f"{stop.stroke:g} mm is never reached: the tool '{name}' comes to rest after {reach:g} mm"
        yield SceneError(sentence, key="stop.stroke", got=stop.stroke, allowed=f"at most {reach:g}")
    for stroke in scene.output.strokes:
        if stop.stroke is not None and stroke > stop.stroke:
            sentence = f"{stroke:g} mm lies behind stop.stroke {stop.stroke:g} mm"
            yield SceneError(sentence, key="output.strokes", got=stroke, allowed=f"at most {stop.stroke:g}")


def _unused(scene):
    tools = {solid.material for *_, solid in solids_of(scene)}
    used = {body.material for body in scene.workpieces.values()} | tools
    if scene.computes_heat:
        used |= {tool_material(scene, name) for name in scene.tools}
    deform = {solid.material for name, _, _, solid in solids_of(scene) if name in scene.deforming_tools}
    for name, material in scene.materials.items():
        if name not in used:
            yield f"materials.{name}: no body is made of it"
            continue
        unused = [] if scene.computes_heat else [(_HEAT, "temperatures are not computed")]
        unused += [] if name in deform else [(_ELASTIC, "elastic strains are not computed")]
        for keys, why in unused:
            for key in keys:
                if material.wrote(key) and getattr(material, key) is not None:
                    yield f"materials.{name}.{key}: has no effect, {why} in this run"
    for name, body in () if scene.computes_heat else scene.workpieces.items():
        if body.temperature is not None and not scene.materials[body.material].flow_stress.depends_on_temperature:
            yield f"workpieces.{name}.temperature: has no effect, the flow stress does not depend on temperature"
