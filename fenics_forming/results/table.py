"""How the table of a run is laid out: its columns, their heads and widths, in the room that there is."""

from __future__ import annotations

WORDS = {
    "newton_iterations": "Newton",
    "dt_s": "dt",
    "wall_s": "wall time",
    "max_effective_strain": "max strain",
    "min_temperature_degC": "coldest",
    "max_temperature_degC": "hottest",
}
UNITS = ("degC", "N_per_mm", "mm_per_s", "per_s", "Nmm", "MPa", "mW", "mJ", "J", "mm3", "mm2", "mm", "N", "s")
SHOWN = {"degC": "°C", "N_per_mm": "N/mm", "mm_per_s": "mm/s", "per_s": "1/s", "mm3": "mm³", "mm2": "mm²", "Nmm": "N mm"}
LEFT_OUT = ("torque_", "contact_pressure_", "max_displacement_", "min_temperature_", "stroke_", "force_")
"""Beginnings of columns that a narrow terminal goes without, the last first; of strokes and forces one stays."""


def name_and_unit(column: str) -> tuple[str, str]:
    """The words and the unit in the name of a column or field: "stroke_upper_mm" → "stroke upper", "mm"."""
    for unit in UNITS:
        if column.endswith("_" + unit):
            return column[: -len(unit) - 1].replace("_", " "), SHOWN.get(unit, unit)
    return column.replace("_", " "), ""


def laid_out(columns: tuple[str, ...], room: float) -> tuple[tuple[str, ...], list[int], list[str]]:
    """The columns that are printed, their widths, and the lines above them.

    Two lines of heads where there is room; else three, the words one below the other; and where that is still too wide,
    fewer columns.

    Parameters
    ----------
    columns : names in the history, in order. room : characters in a line; inf where it does not matter.
    """
    widths, lines = _heads(columns, narrow=False)
    if len(lines[0]) <= room:
        return columns, widths, lines
    while True:
        widths, lines = _heads(columns, narrow=True)
        if max(map(len, lines)) <= room or (dispensable := _dispensable(columns)) is None:
            return columns, widths, lines
        columns = tuple(c for c in columns if c != dispensable)


def _dispensable(columns):
    for start in LEFT_OUT:
        found = [c for c in columns if c.startswith(start)]
        if len(found) > start.startswith(("stroke_", "force_")):
            return found[-1]
    return None


def _heads(columns, *, narrow):
    """Widths of the columns and the lines of the heads; numbers need nine characters, eight if need be, times ten."""
    heads, widths = [], []
    for column in columns:
        words, unit = name_and_unit(column)
        words = WORDS.get(column, words)
        first, _, second = words.partition(" ") if narrow else (words, "", "")
        heads.append((first, second, unit) if narrow else (first, unit))
        least = (10 if column == "time_s" else 8) if narrow else 9
        widths.append(max(*map(len, heads[-1]), least if unit else 6 if not narrow or second or column != "step" else 4))
    limited = ("limited", "by", "") if narrow else ("limited by", "")
    return widths, ["  ".join([*(head[k].rjust(width) for head, width in zip(heads, widths, strict=True)), last]).rstrip()
                    for k, last in enumerate(limited)]
