"""Contact of one body with known tools: rigid surfaces at rest, moving or rotating."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ..parallel import total
from . import point_law as law
from .facets import ContactFacets
from .free_motions import FreeMotions

if TYPE_CHECKING:       # neither sparse matrices nor meshes of tools where no tool deforms
    from .deformed import DeformedSurface

# Times k: sticking is a bound that the material never reaches, since it yields at k; it keeps landing points calm. Of a
# wide surface on the verge of lifting off, more than k closes again what has opened, and so on without end.
STICKING, VERGE = 2.0, 1.0
RISING = 0.1    # of the speed of the tools: at most that fast what has sunk into one comes out again


@dataclass
class ToolMotion:
    """Where a rigid tool is and how it moves: x = centre + displacement + R(angle) (X - centre).

    displacement, velocity (dim,) mm, mm/s; angle rad and angular_velocity rad/s about ``axis`` (z in 2-D) through the
    centre, which moves along.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    angle: float = 0.0
    angular_velocity: float = 0.0
    centre: np.ndarray | None = None
    axis: np.ndarray | None = None

    def rotation(self) -> np.ndarray:
        c, s = np.cos(self.angle), np.sin(self.angle)
        if len(self.displacement) == 2:
            return np.array([[c, -s], [s, c]])
        a = self.axis / np.linalg.norm(self.axis)
        cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
        return np.eye(3) + s * cross + (1 - c) * cross @ cross

    def to_tool(self, points: np.ndarray) -> np.ndarray:
        """Points in space → points in the frame in which the tool's surface was described."""
        if self.centre is None or self.angle == 0.0:
            return points - self.displacement
        return (points - self.displacement - self.centre) @ self.rotation() + self.centre

    def to_space(self, points: np.ndarray) -> np.ndarray:
        """Points in the frame in which the tool's surface was described → points in space."""
        if self.centre is None:
            return points + self.displacement
        return self.turn(points - self.centre) + self.centre + self.displacement

    def turn(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors of the tool's frame → space."""
        return vectors if self.centre is None or self.angle == 0.0 else vectors @ self.rotation().T

    def velocity_at(self, points: np.ndarray) -> np.ndarray:
        """Velocity of the tool's material at points in space, (n, dim), mm/s."""
        v = np.full(points.shape, self.velocity, float)
        if self.centre is None or self.angular_velocity == 0.0:
            return v
        arm = points - (self.centre + self.displacement)
        if points.shape[1] == 2:
            return v + self.angular_velocity * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        return v + self.angular_velocity * np.cross(self.axis / np.linalg.norm(self.axis), arm)

    def spin_at(self, points: np.ndarray) -> np.ndarray:
        """Velocity of the tool's material at points in space per unit angular velocity, (n, dim), mm."""
        return replace(self, velocity=np.zeros_like(self.velocity), angular_velocity=1.0).velocity_at(points)

    def torque(self, points: np.ndarray, forces: np.ndarray) -> float:
        """Moment about the axis of rotation of forces (n, dim) at points, N mm."""
        arm = points - (self.centre + self.displacement)
        if points.shape[1] == 2:
            return float(np.sum(arm[:, 0] * forces[:, 1] - arm[:, 1] * forces[:, 0]))
        return float(np.sum(np.cross(arm, forces) @ (self.axis / np.linalg.norm(self.axis))))


@dataclass
class KnownTool:
    """A tool whose surface and motion are known.

    surface : closest point and normal, in the tool's own frame (``surfaces.py``)
    friction : a law of ``laws.friction`` or None
    motion : where it is now; the controller replaces it
    free : motions that the solve finds (``free_motions``), or None · deformed : its surface where it deforms, or None
    drive : what moves it, or None · deformation : what makes it deform (``process.tool_deformation``), or None
    heat : its temperature field, where it has a mesh for that (``process.tool_heat``), or None
    """

    name: str
    surface: object
    friction: object | None = None
    motion: ToolMotion | None = None
    free: FreeMotions | None = None
    drive: object | None = None
    deformation: object | None = field(default=None, repr=False)
    deformed: DeformedSurface | None = None
    heat: object | None = field(default=None, repr=False)
    state: law.PointState | None = field(default=None, repr=False)
    traction: np.ndarray | None = field(default=None, repr=False)
    tangent: np.ndarray | None = field(default=None, repr=False)
    given_velocity: np.ndarray | None = field(default=None, repr=False)

    def velocities(self) -> list[np.ndarray]:
        """Velocities that measure how fast the tool is, (points, dim), mm/s: its own, and of one that yields a little that
        of its drive; of one that deforms that alone, as its points spring back at any speed."""
        if self.deformation is not None:
            slowed = getattr(self.free, "slowed", None)
            return [self.given_velocity] if slowed is None else slowed(self.given_velocity)
        if self.free is None:
            return [self.given_velocity]
        return [self.state.tool_velocity, self.free.share_of_drive * self.given_velocity]

    @property
    def is_sought(self) -> bool:
        """Whether the solve finds some of its motions."""
        return self.free is not None and not self.free.given

    @property
    def has_friction(self) -> bool:
        return self.friction is not None and self.friction.law != "none"

    @property
    def sticks(self) -> bool:
        return self.has_friction and self.friction.law == "sticking"

    def gap(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed gap and normal out of the tool at points in space."""
        if self.deformed is not None:
            return self.deformed.gap(self.surface, self.motion, points)
        gap, normal = self.surface.closest(self.motion.to_tool(points))
        return gap, self.motion.turn(normal)


class RigidContact:
    """Penalty contact of a body with several known tools, as one traction field over the contact facets.

    The penalty coefficient C, N s/mm³, comes from the diagonal of the first, linear viscous stiffness on the contact
    surface (:meth:`set_penalty`).
    """

    def __init__(self, facets: ContactFacets, tools: list[KnownTool], *, slip_regularisation: float = 1e-3,
                 augmented: bool = False):
        self.facets, self.tools = facets, tools
        self.slip_regularisation, self.augmented = slip_regularisation, augmented
        self.coefficient: float | None = None
        self.reference: float | None = None     # C of the start, for unit flow stress and tool speed
        self.inertia = 0.0                      # what the mass that lands in a step adds to C, N s/mm³
        self.sticking = STICKING                # what a tool that sticks bears in shear, in k
        self.dt = self._speed = 1.0
        self.slip0 = slip_regularisation
        self.weights: np.ndarray | None = None      # of the points, mm² and what goes with them: known by the first search
        self._start()

    def _start(self) -> None:
        for tool in self.tools:
            tool.state = law.PointState.at_rest(self.facets.count, self.facets.dim)
            tool.traction = np.zeros((self.facets.count, self.facets.dim))
            tool.tangent = np.zeros((self.facets.count, self.facets.dim, self.facets.dim))

    def rebuild_stress(self) -> None:
        """Forget the friction stresses and multipliers: the next solve starts from nothing."""
        for tool in self.tools:
            tool.state.friction_stress[:] = 0.0
            tool.state.slip[:] = 0.0
            tool.state.multiplier[:] = 0.0

    def release(self) -> None:
        """No tool presses: pressures, tractions and all that is remembered of them are zero."""
        self.rebuild_stress()
        for tool in self.tools:
            tool.state.pressure[:] = tool.state.grip[:] = 0.0
            tool.state.active[:] = False
            tool.traction, tool.tangent = np.zeros_like(tool.traction), np.zeros_like(tool.tangent)
        self.silence()

    def memory(self) -> dict[str, np.ndarray]:
        """What the next solve starts from, tool by tool, (points, 3 + dim): pressure, grip, whether the solve before had
        pressed, friction stress."""
        return {t.name: np.column_stack([t.state.pressure, t.state.grip, t.state.before, t.state.friction_stress])
                for t in self.tools}

    def resume(self, memory: dict[str, np.ndarray], velocity: np.ndarray) -> None:
        """Take over what :meth:`memory` gave, with the nodal velocities (nodes, dim) of then, on the closest points."""
        for tool in self.tools:
            state, of_tool = tool.state, memory[tool.name]
            state.pressure, state.grip, state.friction_stress = of_tool[:, 0], of_tool[:, 1], of_tool[:, 3:]
            state.active, state.before = state.pressure > 0, of_tool[:, 2] > 0
            state.slip = law.slip_velocity(state, self.facets.trace(velocity))
            tool.traction = state.pressure[:, None] * state.normal - state.friction_stress

    def slip_anew(self, velocity: np.ndarray) -> None:
        """Slip of the nodal velocities (nodes, dim) along tools whose surfaces have changed since."""
        for tool in self.tools:
            tool.state.slip = law.slip_velocity(tool.state, self.facets.trace(velocity))

    def resume_from_nodes(self, pressures: dict[str, np.ndarray], velocity: np.ndarray, reach: float) -> None:
        """Start from nodal pressures (nodes,) of every tool, where its gap is at most ``reach``, on the closest points."""
        memory = {}
        for tool in self.tools:
            pressure = np.maximum(self.facets.trace(pressures[tool.name]), 0.0) * (tool.state.gap <= reach)
            pressed = pressure > 0
            memory[tool.name] = np.column_stack([pressure, pressed, pressed, np.zeros_like(tool.state.normal)])
        self.resume(memory, velocity)

    def silence(self) -> None:
        """No traction: for the stiffness of the body alone."""
        dim = self.facets.dim
        self.facets.set_traction(np.zeros((self.facets.count, dim)), np.zeros((self.facets.count, dim, dim)))

    @property
    def needs_flow_stress(self) -> bool:
        return any(t.has_friction for t in self.tools)

    def set_penalty(self, stiffness: np.ndarray, area: np.ndarray, factor: float, flow_stress: float) -> None:
        """C: ``factor`` times the sum of the stiffness diagonals over the sum of the areas, all contact nodes together.

        One value for the whole surface, so that a uniform pressure sinks in uniformly: with a value for each facet a
        smooth platen would act like a slightly uneven one, and the uniform flow of a perfectly plastic block in plane
        strain, which is not unique, would turn into shear bands.
        """
        self.reference = factor * self.surface_mean(stiffness, area) * self._speed / flow_stress
        self.scale_penalty(flow_stress)

    def surface_mean(self, values: np.ndarray, area: np.ndarray) -> float:
        """Sum of nodal values (nodes,) over the sum of the areas (nodes,), all contact nodes together. Collective."""
        nodes = self.facets.facet_nodes
        sums = self.facets.integral(np.array([[values[nodes].sum(), area[nodes].sum()]]))
        return float(sums[0] / sums[1])

    def scale_penalty(self, flow_stress: float) -> None:
        """C follows the viscosity: in proportion to the mean flow stress, MPa, over the speed of the tools."""
        self.coefficient = self.reference * flow_stress / self._speed + self.inertia

    @property
    def speed(self) -> float:
        """Of the tools, mm/s."""
        return self._speed

    def set_speed(self, speed: float) -> None:
        """The speed of the tools, mm/s, which the slip regularisation and the penalty are relative to, and the speed at
        which points that have sunk in come out again: when a blow dies away, that would be all of the flow otherwise."""
        self._speed = max(speed, 1e-30)
        self.slip0 = self.slip_regularisation * self._speed
        for tool in self.tools:
            tool.state.gap = np.maximum(tool.state.gap, -RISING * self._speed * self.dt)
            if tool.free is not None:
                tool.free.speed = speed
                tool.free.prepare(self.dt)

    def search(self, positions: np.ndarray, dt: float) -> None:
        """Closest points for the body and tools where they are now; contact looks ahead by ``dt``, s."""
        self.facets.follow()
        self.dt = dt
        self.points = self.facets.trace(positions)
        self.weights = self.facets.weights(self.points)
        for tool in self.tools:
            tool.state.before = tool.state.active.copy()
            tool.state.gap, tool.state.normal = tool.gap(self.points)
            tool.state.tool_velocity = tool.given_velocity = tool.motion.velocity_at(self.points)
            if tool.free is not None:
                tool.free.search(self.points, tool.motion, tool.state.gap, tool.state.normal)
                tool.free.prepare(dt)
                tool.state.tool_velocity = tool.given_velocity + tool.free.velocities()

    def let_go(self) -> None:
        """Tools move by themselves as they do where no body opposes them; on the closest points of the last search."""
        for tool in self.tools:
            if tool.free is not None and tool.free.basis is not None and not tool.free.given:
                tool.free.forget()
                tool.free.rate = tool.free.unopposed()
                tool.state.tool_velocity = tool.given_velocity + tool.free.velocities()

    def is_loaded(self, touching: float, ahead: float = 0.0) -> bool:
        """Whether a tool that yields would come nearer where it touches, if nothing opposed it: on this rank. So does one
        that its drive, as fast as it is now, would have touch within ``ahead``, s: a crank just before its dead centre."""
        for tool in (t for t in self.tools if t.free is not None):
            rate = tool.free.rate if tool.free.given else tool.free.unopposed()
            coming = tool.given_velocity + tool.free.velocities(rate)
            closing = np.einsum("pi,pi->p", coming, tool.state.normal)
            driven = np.einsum("pi,pi->p", tool.given_velocity, tool.state.normal)
            near = touching + ahead * np.clip(driven, 0.0, closing.clip(0.0))
            if ((closing > 1e-9 * self._speed) & (tool.state.gap <= near)).any():
                return True
        return False

    def respond(self, velocity: np.ndarray, *, flow_stress: np.ndarray | None = None, touching: float | None = None,
                slip0: float | None = None, grip: str = "new", stuck: str = "new", held: bool = False) -> None:
        """Contact tractions and tangents for nodal velocities (nodes, dim), written into the facet integrals.

        flow_stress : (nodes,) for friction that is limited by it; touching : gap below which every point is closed,
        for the first guess; slip0 : another slip regularisation, for the first guess and for continuation; grip : which
        points friction acts at, see ``point_law.follow_contact``; stuck : the same of tools that stick; held : for the
        first guess too, what was closed stays closed.
        """
        v = self.facets.trace(velocity)
        self.slip0_now = slip0 = self.slip0 if slip0 is None else slip0
        self._flow_stress = self.facets.trace(flow_stress) if flow_stress is not None else None
        traction = np.zeros((self.facets.count, self.facets.dim))
        tangent = np.zeros((self.facets.count, self.facets.dim, self.facets.dim))
        for tool in self.tools:
            state = tool.state
            if tool.free is not None:
                state.tool_velocity = tool.given_velocity + tool.free.velocities()
            closed = None if touching is None else state.gap <= touching
            before = state.active
            law.normal_pressure(state, v, self.coefficient, self.dt,
                                self.facets.staying(before, state.normal) if held else closed, self._speed)
            t, k = law.normal_response(state, self.coefficient)
            if tool.has_friction:
                slip = law.slip_velocity(state, v)
                law.follow_contact(state, before, self._grip_of(tool, stuck if tool.sticks else grip))
                limit = self.limit(tool) if closed is None else self._first_limit(tool, closed)
                law.update_friction_stress(state, slip, limit, slip0)
                ft, fk = law.friction_response(state, limit, slip0)
                t, k = t + ft, k + fk
            tool.traction, tool.tangent = t, k
            traction += t
            tangent += k
        self.facets.set_traction(traction, tangent)

    def _grip_of(self, tool: KnownTool, grip: str) -> str:
        """The same; where a tool did not press before, "before" means "new". Collective where that is asked for."""
        pressed = grip != "before" or total(self.facets.comm, float(np.count_nonzero(tool.state.before)))
        return grip if pressed else "new"

    @property
    def sticks(self) -> bool:
        """Whether the body sticks to one of the tools."""
        return any(tool.sticks for tool in self.tools)

    def limit(self, tool: KnownTool) -> np.ndarray:
        """Friction limit of a tool at the points (points,), N/mm², for the flow stress of the last :meth:`respond`."""
        return self.limit_under(tool, tool.state.pressure, tool.state.grip)

    def _first_limit(self, tool: KnownTool, closed: np.ndarray) -> np.ndarray:
        """Friction limit (points,), N/mm², for the first guess: where a tool touches it presses with the flow stress at
        least. A roll that only turns presses on a body at rest with nothing; what it draws in would be left lying."""
        pressure = tool.state.pressure
        if tool.friction.depends_on_pressure and not tool.sticks:
            pressure = np.where(closed, np.maximum(pressure, self._flow_stress), pressure)
        return self.limit_under(tool, pressure, tool.state.grip)

    def limit_under(self, tool: KnownTool, pressure: np.ndarray, grip: np.ndarray) -> np.ndarray:
        """The same under another pressure (points,), MPa, where the shares ``grip`` (points,) of it rub."""
        flow_stress = self._flow_stress
        if tool.sticks:
            return self.sticking / np.sqrt(3) * flow_stress
        if tool.friction.depends_on_pressure:
            pressure = self._nodal_mean(pressure, grip)
        return tool.friction.limit(pressure, flow_stress)

    def _nodal_mean(self, pressure: np.ndarray, grip: np.ndarray) -> np.ndarray:
        """Pressure that friction depends on, MPa: that at the points of a penalty contact oscillates, its nodal mean not.

        What the mean gives to open points, where nothing rubs, is shared out among the others: all of the force rubs.
        """
        mean = np.maximum(self.facets.smooth(pressure, self.weights), 0.0)
        given, rubbing = self.facets.integral(self.weights[:, None] * np.stack([pressure, mean * grip], axis=1))
        return mean * (given / rubbing if rubbing > 0 else 1.0)

    def augment(self) -> None:
        """Augmented-Lagrange update: the traction found so far becomes the multiplier (zero where contact is open)."""
        for tool in self.tools:
            state = tool.state
            pressure = np.where(state.active, np.maximum(self.facets.linear_part(state.pressure), 0.0), 0.0)
            state.multiplier = pressure[:, None] * state.normal

    def gives_way(self, mass_per_step: float) -> float:
        """Force that would be mistaken for inertia, relative to that of the tools: what the penalty carries beside the
        multipliers moves the whole body, of ``mass_per_step`` t/s, at the speed by which it gives way. Collective."""
        sums = self.facets.integral(np.array([[
            [tool.state.pressure @ self.weights, tool.state.active @ self.weights,
             np.einsum("pi,pi,p->", tool.state.multiplier, tool.state.normal, self.weights)] for tool in self.tools]]))
        force, area, carried = sums.T
        if not force.max(initial=0.0) > 0:
            return 0.0
        beside = np.abs(force - carried).max() / force.max()
        return float(beside * min(1.0, mass_per_step / (self.coefficient * area.max())))

    # ------------------------------------------------------------------ what the tools feel
    def force(self, tool: KnownTool) -> np.ndarray:
        """Force of the tool on the body, (dim,), N (N/mm in plane strain; of the full 360° in axisymmetry)."""
        return total(self.facets.comm, self.weights @ tool.traction)

    def along_motions(self, tool: KnownTool, motions: FreeMotions | None = None) -> np.ndarray:
        """Forces of the tool on the body along its own motions, or others, ∫ Φᵀt, (n,), N. Collective."""
        local = (tool.free if motions is None else motions).basis.T @ (self.weights[:, None] * tool.traction).ravel()
        return total(self.facets.comm, np.asarray(local))

    def forces(self) -> np.ndarray:
        """Forces of all tools on the body, (tools, dim), N."""
        return np.array([self.force(t) for t in self.tools])

    def resultants(self) -> np.ndarray:
        """Forces of the tools as far as they are resultants, (tools, k): in axisymmetry along the axis only."""
        first = 1 if self.facets.axisymmetric else 0
        return self.forces()[:, first:]

    def torque(self, tool: KnownTool) -> float:
        """Moment of the contact tractions on the body about the tool's axis of rotation, N mm."""
        local = tool.motion.torque(self.points, tool.traction * self.weights[:, None])
        return float(self.facets.integral(np.array([local])))

    def pressed_nodes(self) -> dict[str, np.ndarray]:
        """Tool name → (nodes,) whether a node carries pressure of that tool."""
        return {t.name: self.facets.to_nodes(t.state.pressure, self.weights) > 0 for t in self.tools}

    def nodal_pressure(self) -> np.ndarray:
        """Contact pressure at the nodes (nodes,), MPa: hat-weighted mean of the pressure at the points."""
        weights = self.facets.weights() if self.weights is None else self.weights
        return self.facets.to_nodes(sum(t.state.pressure for t in self.tools), weights)

    def powers(self, velocity: np.ndarray) -> dict[str, float]:
        """Power, mW: given by the tools, lost in friction, taken by the penalty and by landing points."""
        v = self.facets.trace(velocity)
        sums = np.zeros(3)
        for tool in self.tools:
            sums += law.powers(tool.state, tool.traction, v, self.weights)
        return dict(zip(("tools", "friction", "penalty"), total(self.facets.comm, sums).tolist(), strict=True))
