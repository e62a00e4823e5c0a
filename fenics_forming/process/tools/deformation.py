r"""Tools and press frames that yield while a workpiece is formed, in one of four modes (FORMULATION.md 5).

``iterated``: their motions are unknowns of every velocity solve (``physics.contact.free_motions``).
``coupled``: at the end of every tool step the tool is solved under the forces of then, :math:`u^i`; until the next one its
surface goes on with :math:`V_d=(u^i-u^{i-1})/(t_i-t_{i-1})`.  ``separate``: the same with :math:`V_d=0`; the surface of the
workpiece is put onto the new surface of the tool.  ``stress_only``: the tool is solved, nobody sees it.
"""

from __future__ import annotations

import numpy as np

from ...errors import ConvergenceError
from ...laws import SpringDrive
from ...physics.contact.free_motions import RigidMotions
from ...scene import Scene, copies
from .stability import LARGEST, Stability, rate_sensitivity

MISMATCH = 1e-3     # of the largest displacement: by which the tangent of a tool that yields may miss where it is
PASSES = 6          # of a solve with the tangents of tools that yield


class Deformation:
    """One tool that yields: what it is made of, its mode, and when it was last solved.

    Parameters
    ----------
    known : the tool as a contact surface · motions : its `FreeMotions`
    tool : `ElasticTool`, None of a rigid tool on a press frame

    Attributes
    ----------
    mode : the one of the scene · fallen_back : whether the guard has put "iterated" in its place for now
    solved_at : s, time of the last tool step · reaction : (n,) N, forces on the body along all that can move then
    deflection : mm, mean yield against the forces of contact, weighted with them
    stability : `Stability`, None before it counts
    """

    def __init__(self, scene: Scene, known, motions, tool=None):
        self.name, self.known, self.motions, self.tool = known.name, known, motions, tool
        self.mode, self._every, self._step = scene.process.tool_deformation, scene.steps.tool_every, scene.steps.tool_step
        self._guarded = self.mode == "coupled" and scene.process.tool_guard
        self.fallen_back = self._guarded        # first contact is no start for the lagged scheme
        self.solved_at, self._steps, self._force, self._sensitivity = 0.0, 0, 0.0, 1.0
        self.deflection, self.reaction = 0.0, np.zeros(0)
        self.stability: Stability | None = None
        self._news: list[str] = []
        known.deformation = self
        self._press = known.free            # of a drive with a force limit, else None
        if self.mode != "stress_only":
            known.free, known.deformed = _in_series(self._press, motions), getattr(motions, "deformed", None)
        motions.given = self.mode != "iterated" and not self.fallen_back

    @property
    def carries_the_surface(self) -> bool:
        """Whether nodes of the workpiece go along where the tool has deformed, whatever the flow is."""
        return self.mode == "separate"

    # ------------------------------------------------------------------ a step
    def begin(self, body, dt: float) -> None:
        """A step of ``dt`` starts: the stability of the tool step to come, and the mode that it asks for. Collective."""
        if self.mode != "coupled":
            return
        if self._force == 0.0:
            if self._guarded and not self.fallen_back:
                self._switch(body, "contact has opened")
            return
        every = self._every if self._step is None or self._step.time is None else max(1, round(self._step.time / dt))
        if self.deflection == 0.0 and self.fallen_back:
            return                                  # not solved under load yet
        change = max(abs(self._along_force(rate * every * dt)) for rate in (self.motions.pace, self.motions.rate))
        self.stability = Stability.of(travel=body.speed * every * dt, sensitivity=self._sensitivity,
                                      deflection=self.deflection, change=change, every=every)
        if self._guarded and self.fallen_back == self.stability.is_safe:
            self._switch(body, f"travel per tool step over its limits {self.stability.lag:.2g} (rate), "
                               f"{self.stability.opening:.2g} (opening)")

    def _switch(self, body, why: str) -> None:
        """From "coupled" to "iterated", or back."""
        self.fallen_back = self.motions.given
        self.motions.given = not self.fallen_back
        self.motions.forget()
        if self.motions.given:
            self.motions.rate = self.motions.pace
        body.solver.renew_border()
        mode = "iterated" if self.fallen_back else "coupled"
        self._news.append(f"tool '{self.name}': {mode} from here on, {why}")

    def end(self, body, time: float) -> bool:
        """A step has ended at ``time``, and the flow there is known: solve the tool where that is due; whether the
        workpiece now meets another surface. Collective."""
        contact, motions = body.contact, self.motions
        if self.mode == "stress_only":
            motions.search(contact.points, self.known.motion, self.known.state.gap, self.known.state.normal)
        self.reaction = motions.spread(contact.along_motions(self.known, motions))
        before, self._force = self._force, float(np.linalg.norm(contact.force(self.known)))
        if self.mode == "iterated":
            self.deflection = self._along_force(motions.displacement - self._at_rest())
            return False
        if self.mode == "coupled" and self._force > 0:
            self._sensitivity = rate_sensitivity(body.workpiece)
        self._steps += 1
        if not self._is_due(time, before):
            return False
        solved = self._solved()
        elapsed, change = time - self.solved_at, solved - motions.earlier
        motions.earlier, self.solved_at, self._steps = solved, time, 0
        self.deflection = self._along_force(solved - self._at_rest())
        if elapsed <= 0:
            return False
        motions.pace = change / elapsed
        if self.fallen_back:
            return False
        motions.displacement, motions.since = solved, time
        motions.rate = motions.pace if self.mode == "coupled" else np.zeros_like(solved)
        return self.mode != "stress_only"

    def _is_due(self, time: float, force: float) -> bool:
        step = self._step
        if step is None:
            return self._steps >= self._every
        late = step.time is not None and time - self.solved_at >= step.time * (1 - 1e-9)
        if step.deflection is None or late:
            return late
        if force == 0.0 or self.deflection == 0.0:
            return True
        return abs(self.deflection) * abs(self._force / force - 1.0) * self._steps >= step.deflection

    def _solved(self) -> np.ndarray:
        """Displacements of the motions under the present forces, (n,), mm. Collective."""
        if self.tool is None or not self.tool.follows_a_tangent:
            return self.motions.under(self.motions.gathered(self.reaction))
        found = self._solve_tool(self.motions.gathered(self.reaction))
        self.tool.accept()
        return found.ravel()[self.motions.unknown]

    def _solve_tool(self, reaction: np.ndarray) -> np.ndarray:
        """Displacements (n, dim) of the surface of a tool that yields, the press frame included. Collective."""
        forces = -self.motions.on_surface(reaction)
        return self.tool.solve(forces) + self.motions.frame_yields(forces)

    def _at_rest(self) -> np.ndarray | float:
        """Displacements of the motions without contact, by what else loads the tool, (n,), mm."""
        return 0.0 if self.tool is None else self.tool.at_rest.ravel()[self.motions.unknown]

    def _along_force(self, displacement: np.ndarray) -> float:
        """Mean of a displacement of the motions against the forces of contact, mm."""
        if self._force == 0 or not len(displacement):
            return 0.0
        return -float(self.motions.gathered(self.reaction) @ displacement) / self._force

    # ------------------------------------------------------------------ tools whose stiffness changes
    def agrees(self, body) -> bool:
        """Whether the tool is where its tangent had it in the solve before; else the tangent is taken anew. Collective."""
        if self.motions.given or self.tool is None or not self.tool.follows_a_tangent or not self.motions.count:
            return True
        motions = self.motions
        reaction = body.contact.along_motions(self.known, motions)
        reaction = motions.at_end(reaction)
        found = self._solve_tool(reaction)
        reached = motions.displacement + motions.horizon * motions.rate
        miss = np.abs(found.ravel()[motions.unknown] - reached).max()
        if miss <= MISMATCH * np.abs(found).max():
            return True
        motions.refresh(found, -motions.on_surface(reaction))
        motions.prepare(motions.horizon)
        return False

    def expand(self, temperature: np.ndarray, stress_free: float) -> None:
        """The tool has temperatures (nodes,) of its mesh, degC, and no thermal strain at ``stress_free``: take over where
        that puts it without contact. Collective."""
        self.tool.body.set_temperature(temperature, stress_free)
        if self.tool.follows_a_tangent:
            return              # solved anew under the forces of contact, from where its tangent is taken
        self.tool.at_rest = self.tool.solve(np.zeros(self.tool.surface.x.shape))
        self.motions.solved_at[0] = self.tool.at_rest.ravel()

    def settle(self) -> None:
        """The step is accepted, and with it what has yielded."""
        if self.tool is not None and not self.motions.given:
            self.tool.accept()

    # ------------------------------------------------------------------ what is recorded
    def row(self) -> dict[str, float]:
        """Columns of the history."""
        row = {f"deflection_{self.name}_mm": self.deflection}
        if self.mode == "coupled":
            row[f"stability_{self.name}"] = LARGEST if self.stability is None else self.stability.number
        return row

    def news(self) -> list[str]:
        """What has changed since this was last asked, one sentence each."""
        said, self._news = self._news, []
        return said

    def field(self):
        """Stresses and displacements of the tool under the forces of the last step (`ToolField`); before the first one
        there are none. Collective."""
        if not self.tool.follows_a_tangent:
            reaction = self.reaction if len(self.reaction) else np.zeros(self.tool.surface.x.size)
            self.tool.solve(-reaction.reshape(self.tool.surface.x.shape))
        return self.tool.field()

    def summary(self) -> dict:
        """For the summary of the run: the mode, and what it has taken."""
        found = {"mode": self.mode, "deflection_mm": self.deflection, "unknowns": self.motions.count}
        return found | ({} if self.tool is None else {"factorisations": self.tool.solver.factor.factorisations})

    # ------------------------------------------------------------------ going back
    def snapshot(self) -> tuple:
        """What a failed step must give back."""
        return (self.motions.memory(), self.fallen_back, self.solved_at, self._steps, self._force, self.deflection,
                self.reaction, self._sensitivity, None if self._press is None else self._press.memory(),
                None if self.tool is None else self.tool.snapshot())

    def restore(self, body, snapshot: tuple) -> None:
        """Take over what :meth:`snapshot` gave."""
        if self.tool is not None:
            self.tool.restore(snapshot[-1])
        if self._press is not None:
            self._press.remember(snapshot[-2])
        given = self.motions.given
        self.motions.remember(snapshot[0])
        self.fallen_back, self.solved_at, self._steps, self._force, self.deflection, self.reaction, self._sensitivity = \
            snapshot[1:-2]
        if given != self.motions.given:
            body.solver.renew_border()

    def memory(self) -> dict:
        """What a run that is resumed must know, as JSON can hold it."""
        return {"motions": _listed(self.motions.memory()), "fallen_back": self.fallen_back, "solved_at": self.solved_at,
                "steps": self._steps,
                "sensitivity": self._sensitivity, "force": self._force, "deflection": self.deflection,
                "reaction": self.reaction.tolist(),
                "press": None if self._press is None else _listed(self._press.memory())}

    def remember(self, body, memory: dict, stiffness: np.ndarray | None = None) -> None:
        """Take over what :meth:`memory` gave, and the stiffness of the motions then, where it may have changed."""
        self.motions.remember(memory["motions"])
        if stiffness is not None:
            self.motions.stiffness = stiffness
        self.fallen_back, self.solved_at, self._steps = memory["fallen_back"], memory["solved_at"], memory["steps"]
        self._sensitivity = memory["sensitivity"]
        if self._press is not None:
            self._press.remember(memory["press"])
        self._force, self.deflection, self.reaction = memory["force"], memory["deflection"], np.array(memory["reaction"])
        body.solver.renew_border()


def _in_series(press, motions):
    """The motions of a tool that deforms or yields, behind those of a press that its force limit may hold back."""
    if press is None:
        return motions
    from ...physics.contact.motions_in_series import MotionsInSeries
    return MotionsInSeries(press, motions)


def _listed(memory: dict) -> dict:
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in memory.items()}


def agree(body, once) -> int:
    """Solve again, by ``once() -> iterations``, until tools that yield are where their tangents had them; the iterations.
    Collective.

    Raises
    ------
    ConvergenceError
        if they do not come to agree, or a tool cannot carry the forces.
    """
    spent = 0
    for _ in range(PASSES):
        if all([deformation.agrees(body) for deformation in body.deformations]):
            return spent
        spent += once()
    raise ConvergenceError(f"tools that yield and the workpiece do not agree after {PASSES} solves",
                           advice="try smaller steps")


def yielding_tools(scene: Scene, tools, comm) -> list[Deformation]:
    """The tools of a scene that deform or are on a press frame that does; their contact surfaces know of it. Collective."""
    found = []
    for known in (tool for tool in tools if tool.name in scene.yielding_tools):
        drive = scene.tools[known.name].drive
        frame = None
        stiffness = None if drive is None else getattr(drive, "stiffness", None)        # also that of a spring support
        known.free = None if isinstance(drive, SpringDrive) else known.free             # which is then the frame
        if stiffness is not None:
            frame = np.asarray(drive.direction, float), stiffness / copies(scene, drive.direction)
        if known.name in scene.deforming_tools:
            from ...physics.contact.elastic_motions import ElasticMotions
            from .elastic import ElasticTool

            tool = ElasticTool(scene, known.name, comm)
            motions = ElasticMotions(tool.surface, comm, tool.compliance, frame=frame, at_rest=tool.at_rest,
                                     rolls=scene.tools[known.name].rolls)
            found.append(Deformation(scene, known, motions, tool))
        else:
            found.append(Deformation(scene, known, RigidMotions([-frame[0]], stiffness=frame[1])))
    return found
