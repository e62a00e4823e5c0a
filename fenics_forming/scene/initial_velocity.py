"""How a body moves at the start: what the user writes, and whether it can be meant."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator

from ..errors import SceneError
from ..laws.described import Described, one_of
from ..laws.equipment import Spin
from ..units import Length, Rate, Speed, Vector

HELD = 1e-9      # of a velocity: what is smaller across a mirror plane is rounding


class UniformVelocity(Described):
    """The same velocity everywhere; short: a list of its components.

    Parameters
    ----------
    velocity : mm/s, one component for each axis.
    """

    kind: Literal["uniform"] = "uniform"
    velocity: Vector(Speed)

    @property
    def dimension(self):
        return len(self.velocity)

    def at(self, points, geometry):
        """Velocities (n, dim), mm/s, at points (n, dim)."""
        return np.broadcast_to(np.array(self.velocity), points.shape)


class HomogeneousVelocity(Described):
    """That of homogeneous stretching along an axis at constant volume: it stretches along ``axis`` by ``rate`` and
    narrows across by half of it on either other axis, in plane strain by all of it on the one.

    Parameters
    ----------
    rate : 1/s, negative for upsetting: minus the speed of a platen over the height. axis : of the geometry.
    centre : the point that rests, mm; the origin if not given.
    """

    kind: Literal["homogeneous"]
    rate: Rate
    axis: Literal["x", "y", "z"]
    centre: Vector(Length) | None = None

    @property
    def dimension(self):
        return None if self.centre is None else len(self.centre)

    def at(self, points, geometry):
        """Velocities (n, dim), mm/s, at points (n, dim)."""
        axis = {"plane_strain": "xy", "axisymmetric": "rz", "3d": "xyz"}[geometry].index(self.axis)
        across = -self.rate if geometry == "plane_strain" else -0.5 * self.rate
        rates = np.full(points.shape[1], across)
        rates[axis] = self.rate
        return rates * (points - (0.0 if self.centre is None else np.array(self.centre)))


class TurningVelocity(Spin):
    """That of a body that turns about a centre (and an axis in 3d), as a `Spin`."""

    kind: Literal["rotation"]

    @property
    def dimension(self):
        return len(self.centre)

    def at(self, points, geometry):
        """Velocities (n, dim), mm/s, at points (n, dim)."""
        arm = points - np.array(self.centre)
        if points.shape[1] == 2:
            return self.speed * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        axis = np.array(self.axis or (0.0, 0.0, 1.0), float)
        return self.speed * np.cross(axis / np.linalg.norm(axis), arm)


def _field(value):
    return {"kind": "uniform", "velocity": value} if isinstance(value, (list, tuple)) else value


InitialVelocity = Annotated[one_of("kind", UniformVelocity, HomogeneousVelocity, TurningVelocity), BeforeValidator(_field)]


# ---------------------------------------------------------------------- whether it makes sense
def inertia_problems(scene):
    """SceneErrors of what inertia, weight and initial velocities need and do not have."""
    process = scene.process
    acting = [word for word in ("inertia", "weight") if getattr(process, word)]
    for name, body in scene.workpieces.items():
        if acting and scene.materials[body.material].density is None:
            sentence = f"is missing; process.{acting[0]} acts on the workpiece '{name}'"
            yield SceneError(sentence, key=f"materials.{body.material}.density", allowed="a density such as '7850 kg/m^3'")
        if process.weight and scene.axes[-1] in body.symmetry:
            sentence = f"'{scene.axes[-1]}': the weight acts along this axis and is no mirror image of itself"
            yield SceneError(sentence, key=f"workpieces.{name}.symmetry", got=scene.axes[-1],
                             allowed="the other axes, or process.weight = false")
        if body.initial_velocity is not None:
            yield from _velocity_problems(scene, f"workpieces.{name}.initial_velocity", body)


def _velocity_problems(scene, key, body):
    given = body.initial_velocity
    if not scene.process.inertia:
        sentence = "has no effect without inertia; expected process.inertia = true with it"
        yield SceneError(sentence, key=key, got=given, allowed="process.inertia = true")
    if given.dimension not in (None, scene.dimension):
        sentence = f"has {given.dimension} components; '{scene.geometry}' has the {scene.dimension} axes " + \
            ", ".join(scene.axes)
        yield SceneError(sentence, key=key, got=given.dimension, allowed=scene.dimension)
        return
    if given.kind == "homogeneous" and given.axis not in (scene.axes[1:] if scene.axes[0] == "r" else scene.axes):
        sentence = f"'{given.axis}' is no axis along which a body of '{scene.geometry}' can stretch"
        yield SceneError(sentence, key=f"{key}.axis", got=given.axis, allowed="z" if scene.axes[0] == "r" else scene.axes)
    elif given.kind == "rotation" and scene.geometry == "axisymmetric":
        sentence = "turns the body about the axis, or out of its axisymmetry; expected 'uniform' or 'homogeneous'"
        yield SceneError(sentence, key=f"{key}.kind", got="rotation", allowed="'uniform' or 'homogeneous'")
    elif given.kind == "rotation" and scene.scheme != "midpoint":
        sentence = f"is slowed down by the scheme '{scene.scheme}', 10 % in a turn of 144 steps; the midpoint one keeps it"
        yield SceneError(sentence, key=f"{key}.kind", got="rotation", allowed="steps.scheme = 'implicit'")
    elif body.shape.file is None:
        yield from _mirror_problems(scene, key, body)


def _mirror_problems(scene, key, body):
    """The velocity on a mirror plane, and on the axis of rotation, lies in it."""
    samples = np.asarray(body.shape.boundary_points(float(np.ptp(body.shape.bounds(), axis=0).max()) / 20))
    low, high = body.shape.bounds()
    for axis in (*(["r"] if scene.axes[0] == "r" else []), *body.symmetry):
        number = scene.axes.index(axis)
        plane = 0.0 if axis == "r" else low[number]
        on = samples.copy()
        on[:, number] = plane
        velocity = body.initial_velocity.at(on, scene.geometry)
        if np.abs(velocity[:, number]).max() > HELD * np.abs(body.initial_velocity.at(samples, scene.geometry)).max():
            what = "axis of rotation" if axis == "r" else f"mirror plane of '{axis}'"
            sentence = f"crosses the {what}; expected no component across it there"
            yield SceneError(sentence, key=key, got=body.initial_velocity, allowed=f"nothing along {axis} at {plane:g} mm")


def moves_by_itself(scene):
    """Whether a body moves without any tool that moves: by its weight, or by what it does at the start."""
    return scene.process.weight or any(body.initial_velocity is not None for body in scene.workpieces.values())


def undriven_problems(scene):
    """SceneErrors of steps and stops that count the stroke of a tool, where no tool moves."""
    asked = {"steps.stroke": scene.steps.stroke, "stop.stroke": scene.stop.stroke, "stop.force": scene.stop.force,
             "stop.dead_centre": scene.stop.dead_centre or None, "output.strokes": scene.output.strokes or None}
    if scene.stop.time is None:
        yield SceneError("is missing; no tool moves, and a body that comes to rest ends no run", key="stop.time",
                         allowed="a time such as '0.1 s'")
    for key in (key for key, value in asked.items() if value is not None):
        yield SceneError("no tool moves that has a stroke or a force to count; expected steps.time, and stop.time "
                         "with or without stop.height", key=key, got=asked[key], allowed="times, or a height")
