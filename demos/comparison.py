"""Ours, reference, deviation: the table that every demo ends with."""

from __future__ import annotations

from dataclasses import dataclass

from fenics_forming import FormingError


class Disagreement(FormingError):
    """A demo is outside the tolerance of its reference."""


@dataclass(frozen=True)
class Compared:
    """A computed value beside its reference.

    Parameters
    ----------
    what : the quantity, with its unit. ours, reference : its values. source : where the reference comes from.
    tolerance : allowed deviation, relative; absolute, in the unit of the quantity, where ``relative`` is False.
    """

    what: str
    ours: float
    reference: float
    tolerance: float
    source: str
    relative: bool = True

    @property
    def deviation(self) -> float:
        """Ours against the reference, relative or absolute as the tolerance is."""
        difference = self.ours - self.reference
        return difference / abs(self.reference) if self.relative else difference

    @property
    def agrees(self) -> bool:
        return abs(self.deviation) <= self.tolerance

    def texts(self) -> list[str]:
        """The row of the table."""
        deviation, allowed = (f"{100 * self.deviation:+.2f} %", f"{100 * self.tolerance:.2f} %") if self.relative \
            else (f"{self.deviation:+.3f}", f"{self.tolerance:.3f}")
        return [self.what, f"{self.ours:.5g}", f"{self.reference:.5g}", deviation, allowed, self.source]


def compare(rows: list[Compared], *, quiet: bool = False) -> None:
    """Print the table of the rows and insist that all of them agree.

    Raises
    ------
    Disagreement
        naming every row that is outside its tolerance.
    """
    table = [["", "ours", "reference", "deviation", "allowed", "source"], *(row.texts() for row in rows)]
    if not quiet:
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        for line in table:
            numbers = [text.rjust(width) for text, width in zip(line[1:5], widths[1:5], strict=True)]
            print("  ".join([line[0].ljust(widths[0]), *numbers, line[5]]))
    wrong = [row for row in rows if not row.agrees]
    if wrong:
        raise Disagreement("outside the tolerance: " + "; ".join(
            f"{row.what}: {row.ours:.5g} instead of {row.reference:.5g} ({row.source})" for row in wrong))
