"""The powers of the flow of a body between its tools."""

from __future__ import annotations

from ..physics.contact.landing import share_on_the_body


class BodyPowers:
    """What the present flow of a `FlowingBody` takes and gives; mixed into it."""

    def powers(self) -> dict[str, float]:
        """Powers of the present flow, mW, by name."""
        w = self.workpiece
        powers = {"plastic": w.plastic_power(), "body force": w.body_force_power(), **w.mass_powers()}
        if self.contact is None:
            return powers | {"tools": 0.0, "friction": 0.0, "penalty": 0.0}
        powers |= self._contact_powers()
        landing = (1.0 - self.share_on_the_body()) * powers["tools"]
        if landing > 0:         # apart from both sides of the balance
            powers |= {"tools": powers["tools"] - landing, "penalty": powers["penalty"] - landing, "landing": landing}
        return powers

    def _contact_powers(self) -> dict[str, float]:
        """Powers of all contacts, mW: given by tools, friction, and what is no physics: penalty and drag."""
        velocity = self.workpiece.velocity
        powers = self.contact.powers(velocity)
        powers["penalty"] += self.workpiece.drag_power()
        between = self.interfaces.powers(velocity) if self.interfaces is not None else {}
        return powers | {name: powers[name] + power for name, power in between.items()}

    def share_on_the_body(self) -> float:
        """Share of the forces of the tools that acts on the body now; the rest is that of points that land within the step
        (``contact.landing``). All forces have the same share, so that they balance as before; and all of it where forces
        are not just what given motions take: of tools that yield or spend their energy, with inertia, weight, other loads.
        Collective."""
        if self.contact is None or self.workpiece.is_cold or self.tools_yield:
            return 1.0
        return share_on_the_body(self.contact)

    @property
    def tools_yield(self) -> bool:
        """Whether forces are not just what given motions take."""
        return bool(self._flows_by_itself or self.workpiece.mass is not None or self.rams.by_tool or
                    any(tool.free is not None or tool.deformation is not None for tool in self.tools))

    def landing_share(self) -> float:
        """Power taken by landing points and by the penalty, relative to that of the tools; 0 at rest."""
        if self.contact is None or self.workpiece.is_cold:
            return 0.0
        powers = self._contact_powers()
        return abs(powers["penalty"]) / powers["tools"] if powers["tools"] > 0 else 0.0
