"""Contact between bodies of a scene: what the user writes, and whether it can be meant."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from ..errors import SceneError
from ..laws import FrictionLaw, NoFriction
from ..laws.described import Described, at_key, unknown_word
from ..units import HeatTransferCoefficient, Length, NonNegative, Positive, refused

ELEMENTS = ("integration_point", "node")
SAME = 0.02      # of a drawn overlap: an interference that differs by less is that
NEAR = 0.02      # of the size of a body: surfaces that are nearer than this at the start may touch


def _pair(value):
    expected = "a list of two names such as ['core', 'sleeve']"
    if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__len__"):
        raise refused(value, "is not a list", expected)
    if len(value) != 2 or not all(isinstance(name, str) for name in value):
        raise refused(list(value), "does not name two bodies", expected)
    if value[0] == value[1]:
        raise refused(list(value), "names one body twice; contact of a body with itself is not modelled", expected)
    return tuple(value)


class Contact(Described):
    """Contact between two bodies.

    Parameters
    ----------
    between : names of the two bodies. friction : between their surfaces, none if not given.
    interference : overlap that they have at the start, mm, drawn in their shapes or not, which presses them apart; without
    it a gap between the shapes stays one.
    element : where contact is looked at, the "integration_point"s of the finer surface or its nodes ("node", the
    classical node-to-facet element).
    conductance : of heat between two workpieces where they touch, mJ/s/mm^2/K; none goes over if not given.
    """

    between: Annotated[tuple[str, str], BeforeValidator(_pair)] = Field(description="the names of two bodies")
    friction: FrictionLaw = NoFriction()
    interference: NonNegative(Length) = 0.0
    element: Literal["integration_point", "node"] = "integration_point"
    conductance: Positive(HeatTransferCoefficient) | None = None

    @property
    def name(self):
        """Such as "core-sleeve"."""
        return "-".join(self.between)


def _contacts(value):
    if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__len__"):
        raise refused(value, "is not a list", "tables [[contacts]] with 'between'")
    pairs = [frozenset(v.between) for v in value if isinstance(v, Contact)]
    pairs += [frozenset(v["between"]) for v in value if isinstance(v, dict) and isinstance(v.get("between"), (list, tuple))
              and all(isinstance(name, str) for name in v["between"])]
    for number, pair in enumerate(pairs):
        if pair in pairs[:number]:
            names = " and ".join(sorted(pair))
            raise at_key(f"{number}.between", f"names {names} again; expected one contact for two bodies", sorted(pair))
    return tuple(value)


Contacts = Annotated[tuple[Contact, ...], BeforeValidator(_contacts)]


# ---------------------------------------------------------------------- whether it makes sense
def contact_problems(scene):
    """SceneErrors of contacts, and of what several workpieces cannot have."""
    tool_of = {part: name for name, tool in scene.tools.items() for part in tool.parts}
    for number, contact in enumerate(scene.contacts):
        names = [*scene.workpieces, *tool_of]
        for name in contact.between:
            if name not in names:
                what = "part of a tool or a workpiece" if tool_of else "workpiece"
                yield unknown_word(f"'{name}' is not the name of a {what}", name, names, f"contacts.{number}.between")
        if set(contact.between) <= set(names) and len({tool_of.get(name) for name in contact.between}) > 1:
            sentence = "are no two workpieces and no two parts of one tool"
            yield SceneError(f"'{contact.between[0]}' and '{contact.between[1]}' {sentence}",
                             key=f"contacts.{number}.between", got=contact.between, allowed="bodies of one kind")
        if contact.conductance is not None and tool_of.keys() & set(contact.between):
            yield SceneError("is of heat between workpieces; between parts of a tool none is computed",
                             key=f"contacts.{number}.conductance", got=contact.conductance, allowed="nothing")
    yield from _limits_without_yield(scene, tool_of)


def _limits_without_yield(scene, tool_of):
    """SceneErrors of friction that is a part of the yield stress, between parts of a tool that cannot yield."""
    for number, contact in enumerate(scene.contacts):
        parts = [scene.tools[tool_of[name]].parts[name] for name in contact.between if name in tool_of]
        if len(parts) < 2 or contact.friction.law not in ("siebel", "levanov"):
            continue
        laws = [scene.materials[part.material].elasticity for part in parts if part.material in scene.materials]
        if not any(law is not None and law.yields for law in laws):
            yield SceneError("is a part of the yield stress, and neither part can yield; give one a yield_stress, or take "
                             "'coulomb'", key=f"contacts.{number}.friction", got=contact.friction, allowed="coulomb")


def pair_problems(scene):
    """SceneErrors of workpieces that overlap by more than the interference of their contact, or are mirrored apart."""
    interference = {frozenset(c.between): c.interference for c in scene.contacts}
    planes = {}
    for name, body in _with_shapes(scene):
        for axis in body.symmetry:
            at = _mirror(body.shape, scene.axes.index(axis))
            first, place = planes.setdefault(axis, (name, at))
            if abs(at - place) > 1e-6 * _size(body):
                sentence = f"'{axis}': mirrors the body at {at:g} mm, but '{first}' at {place:g} mm; a scene has one plane"
                yield SceneError(sentence, key=f"workpieces.{name}.symmetry", got=axis, allowed="one plane on an axis")
    for (name, body), (other, second) in _pairs(scene):
        allowed = interference.get(frozenset((name, other)), 0.0)
        slack = 2e-3 * min(_size(body), _size(second))
        if _overlap(body.shape, second.shape, allowed + slack) or _overlap(second.shape, body.shape, allowed + slack):
            sentence = f"overlaps the workpiece '{name}' at the start; move it, or give the interference of their contact"
            yield SceneError(sentence, key=f"workpieces.{other}.shape", got=second.shape, allowed="no overlap")


def drawn_overlap(scene, contact):
    """How deep the shapes of two workpieces in contact overlap as they are drawn, mm; 0 where their kinds do not tell."""
    return _depth_of_overlap(*(scene.workpieces[name].shape for name in contact.between))


def part_warnings(scene):
    """Sentences about interferences of parts of a tool that are not those their shapes are drawn with."""
    parts = {name: part for tool in scene.tools.values() for name, part in tool.parts.items()}
    for number, contact in enumerate(scene.contacts):
        if not contact.says("interference") or not set(contact.between) <= parts.keys():
            continue
        one, other = contact.between
        drawn = _depth_of_overlap(parts[one].shape, parts[other].shape)
        if drawn > 1e-6 * np.ptp(parts[one].shape.bounds()) and abs(drawn - contact.interference) > SAME * drawn:
            yield (f"contacts.{number}.interference: {contact.interference:.3g} mm takes the place of the overlap of "
                   f"{drawn:.3g} mm that '{one}' and '{other}' are drawn with")


def _depth_of_overlap(one, other):
    if any(shape is None or shape.file is not None or not hasattr(shape, "depth") for shape in (one, other)):
        return 0.0
    depths = (a.depth(b.boundary_points(np.ptp(b.bounds(), axis=0).max() / 100)).max()
              for a, b in ((one, other), (other, one)))
    return max(0.0, *(float(depth) for depth in depths))


def pair_warnings(scene):
    """Sentences about bodies that may touch though the scene names no contact between them."""
    named = {frozenset(c.between) for c in scene.contacts}
    for (name, body), (other, second) in _pairs(scene):
        if frozenset((name, other)) not in named and _may_touch(body.shape, second.shape, NEAR * _size(body)):
            yield (f"workpieces.{other}: starts at the surface of '{name}', but no [[contacts]] keeps the two apart: "
                   "they will move through one another")


def _mirror(shape, number):
    """Where a shape is mirrored across an axis: at its low face, a round one through its centre."""
    if shape.kind == "circle":
        return float(shape.centre[number])
    if shape.kind == "cylinder" and abs(shape.axis[number]) < 1e-12:
        return float(shape.base[number])
    return float(shape.bounds()[0, number])


def _with_shapes(scene):
    return [(name, body) for name, body in scene.workpieces.items() if body.shape.file is None]


def _pairs(scene):
    bodies = _with_shapes(scene)
    return [(bodies[i], bodies[j]) for j in range(len(bodies)) for i in range(j)]


def _size(body):
    return float(np.ptp(body.shape.bounds(), axis=0).max())


def _overlap(shape, other, depth):
    """Whether samples of the surface of ``shape``, moved inwards by ``depth``, lie in ``other``."""
    samples = shape.boundary_points(np.ptp(shape.bounds(), axis=0).max() / 100)
    if hasattr(other, "depth"):
        return bool(other.depth(samples).max() > depth)
    middle = shape.bounds().mean(axis=0)
    inwards = middle - samples
    length = np.linalg.norm(inwards, axis=1, keepdims=True)
    return bool(other.contains(samples + np.minimum(2 * depth, 0.5 * length) * inwards / length).any())


def _may_touch(shape, other, reach):
    low, high = shape.bounds()
    other_low, other_high = other.bounds()
    if (low > other_high + reach).any() or (other_low > high + reach).any():
        return False
    if hasattr(other, "depth"):
        return bool(other.depth(shape.boundary_points(reach / 2)).max() > -reach)
    return True
