"""The powers of the flow of a body between its tools."""

from __future__ import annotations


class BodyPowers:
    """What the present flow of a `FlowingBody` takes and gives; mixed into it."""

    def powers(self) -> dict[str, float]:
        """Powers of the present flow, mW, by name."""
        w = self.workpiece
        powers = {"plastic": w.plastic_power(), "body force": w.body_force_power(), **w.mass_powers()}
        if self.contact is None:
            return powers | {"tools": 0.0, "friction": 0.0, "penalty": 0.0}
        return powers | self._contact_powers()

    def _contact_powers(self) -> dict[str, float]:
        """Powers of all contacts, mW: given by tools, friction, and what is no physics: penalty and drag."""
        velocity = self.workpiece.velocity
        powers = self.contact.powers(velocity)
        powers["penalty"] += self.workpiece.drag_power()
        between = self.interfaces.powers(velocity) if self.interfaces is not None else {}
        return powers | {name: powers[name] + power for name, power in between.items()}

    def landing_share(self) -> float:
        """Power taken by landing points and by the penalty, relative to that of the tools; 0 at rest."""
        if self.contact is None or self.workpiece.is_cold:
            return 0.0
        powers = self._contact_powers()
        return abs(powers["penalty"]) / powers["tools"] if powers["tools"] > 0 else 0.0
