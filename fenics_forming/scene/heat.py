"""Whether a scene computes temperatures, and what it must say for that."""

from ..errors import SceneError
from ..laws.described import unknown_word

NEEDED = ("density", "conductivity", "specific_heat")


def asks_for_heat(scene):
    """The first dotted key by which a scene asks for temperatures to be computed; None where it does not."""
    if scene.process.heat is False:
        return None
    if scene.process.heat:
        return "process.heat"
    if not scene.process.flow:
        return "process.flow"
    if scene.process.cooling:
        return "process.cooling"
    for name, body in scene.workpieces.items():
        if body.air is not None:
            return f"workpieces.{name}.air"
        material = scene.materials.get(body.material)
        if body.temperature is not None and material is not None and material.wrote("plastic_heat_fraction") \
                and material.plastic_heat_fraction and not missing(material):
            return f"materials.{body.material}.plastic_heat_fraction"
    return next((f"tools.{name}.heat_exchange" for name, tool in scene.tools.items() if tool.heat_exchange.acts), None)


def missing(material):
    """Keys that a material lacks for its temperature to be computed."""
    return [key for key in NEEDED if getattr(material, key) is None]


def tool_material(scene, name):
    """Name of the material that a tool exchanges heat as; None where it is not known."""
    return getattr(scene.tools[name].heat_exchange, "material", None) or getattr(scene.tools[name], "material", None)


def heat_problems(scene):
    """What makes a scene that asks for temperatures impossible, as `SceneError`s."""
    asking = asks_for_heat(scene)
    if asking is None:
        return
    for name, body in scene.workpieces.items():
        if body.temperature is None:
            yield SceneError(f"is missing; {asking} asks for temperatures to be computed",
                             key=f"workpieces.{name}.temperature", allowed="a temperature such as '1150 degC'")
        for key in missing(scene.materials[body.material]):
            yield SceneError(f"is missing; {asking} asks for temperatures to be computed",
                             key=f"materials.{body.material}.{key}", allowed="a positive quantity")
    for name in scene.tools:
        yield from _tool_problems(scene, name)


def flowless_problems(scene):
    """What a scene without flow says that belongs to one with it, as `SceneError`s."""
    steps, stop, process = scene.steps, scene.stop, scene.process
    for key, value, sentence in (
            ("process.heat", process.heat is False, "is false, and so is process.flow: there is nothing to compute"),
            ("steps.stroke", steps.stroke, "is the size of a step of a tool; without flow expected steps.time"),
            ("steps.adaptive", steps.adaptive, "belongs to a flow; without one expected no 'adaptive'"),
            ("process.inertia", process.inertia, "needs a flow"),
            ("process.weight", process.weight, "needs a flow"),
            ("flow_lines", scene.flow_lines, "follow material that flows; expected none")):
        if value:
            yield SceneError(sentence, key=key, got=value)
    if stop.time is None or any((stop.stroke, stop.force, stop.height, stop.dead_centre, stop.energy_spent)):
        yield SceneError("without flow a run stops at a time, and at nothing else", key="stop", allowed="time")
    elif steps.time is not None and steps.time > stop.time:
        sentence = f"{steps.time:g} s is larger than stop.time {stop.time:g} s; the run would end within its first step"
        yield SceneError(sentence, key="steps.time", got=steps.time, allowed=f"at most {stop.time:g}")
    for name, tool in scene.tools.items():
        if tool.drive is not None:
            yield SceneError("moves the tool, and nothing is formed; expected no drive", key=f"tools.{name}.drive",
                             got=tool.drive, allowed="nothing")
    for name, body in scene.workpieces.items():
        for key in ("remesh", "initial_velocity"):
            if getattr(body, key) is not None:
                yield SceneError("belongs to a flow; without one expected none", key=f"workpieces.{name}.{key}")


def _tool_problems(scene, name):
    law = scene.tools[name].heat_exchange
    if law.kind not in ("column", "coupled"):
        return
    material, key = tool_material(scene, name), f"tools.{name}.heat_exchange.material"
    if material is None:
        yield SceneError(f"is missing; heat exchange of the kind '{law.kind}' needs the material of the tool", key=key,
                         allowed="the name of a material")
    elif material not in scene.materials:
        yield unknown_word(f"'{material}' is not the name of a material", material, scene.materials, key)
    else:
        if law.kind == "coupled" and not hasattr(scene.tools[name].shape, "volume_or_area") or \
                getattr(scene.tools[name].shape, "hollow", False):
            yield SceneError("has no volume to be meshed; heat exchange of the kind 'coupled' needs a closed shape",
                             key=f"tools.{name}.shape", allowed="rectangle, polygon, circle, or a file")
        for needed in missing(scene.materials[material]):
            yield SceneError(f"is missing; the tool '{name}' is made of '{material}' and takes up heat",
                             key=f"materials.{material}.{needed}", allowed="a positive quantity")


def heat_warnings(scene):
    """What in a scene may be meant otherwise, one sentence each."""
    if scene.process.heat is False:
        given = [f"workpieces.{name}.air" for name, body in scene.workpieces.items() if body.air is not None]
        given += [f"tools.{name}.heat_exchange" for name, tool in scene.tools.items() if tool.heat_exchange.acts]
        yield from (f"{key}: has no effect, process.heat is false" for key in given)
    if asks_for_heat(scene) is None:
        yield from (f"contacts.{number}.conductance: has no effect, no temperatures are computed"
                    for number, contact in enumerate(scene.contacts) if contact.conductance is not None)
        return
    for name, tool in scene.tools.items():
        if tool.parts and tool.heat_exchange.kind == "coupled":
            yield f"tools.{name}.heat_exchange: heat stays in the part that it goes into, none is conducted to others"
    for number, contact in enumerate(scene.contacts):
        if set(contact.between) <= set(scene.workpieces) and contact.conductance is None:
            yield f"contacts.{number}.conductance: is not given, no heat goes from one of these workpieces to the other"
    for body in scene.workpieces.values():
        if scene.process.flow and scene.materials[body.material].plastic_heat_fraction is None:
            yield f"materials.{body.material}.plastic_heat_fraction: is not given, plastic work does not heat the body"
