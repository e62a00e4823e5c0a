"""Columns of a CSV file as arrays in internal units."""

import csv
import re

import numpy as np

from ..errors import did_you_mean
from .described import at_key


def read_columns(path, kinds, *, key="file"):
    """Columns of a CSV file by the names in its first line.

    Parameters
    ----------
    path : the file. A header cell is a name ("stress") or a name with a unit ("stress [GPa]").
    kinds : mapping from every allowed name to the `Kind` of quantity of its cells.
    key : the key of the scene that names the file, for messages.

    Returns
    -------
    dict from the names found to 1-D arrays in internal units.

    Raises
    ------
    PydanticCustomError (turned into a `SceneError`) naming the file, line and column that cannot be read.
    """
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError) as error:
        reason = "does not exist" if isinstance(error, FileNotFoundError) else "cannot be read"
        raise at_key(key, f"the file '{path}' {reason}", str(path)) from None
    if len(rows) < 2:
        raise at_key(key, f"'{path}' needs a line of column names ({', '.join(kinds)}) and at least one row", str(path))
    names, units = zip(*(_name_and_unit(cell) for cell in rows[0]), strict=True)
    for name in names:
        if name not in kinds or names.count(name) > 1:
            why = "twice" if name in kinds else f"unknown; {did_you_mean(name, kinds)} allowed: {', '.join(kinds)}"
            raise at_key(key, f"'{path}' has the column '{name}', which is {why}", name, list(kinds))
    columns = {name: [] for name in names}
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(names):
            raise at_key(key, f"'{path}' row {line} has {len(row)} cells, not {len(names)}", row)
        for name, unit, cell in zip(names, units, row, strict=True):
            columns[name].append(_value(cell, unit, kinds[name], f"'{path}' row {line}, column '{name}'", key))
    return {name: np.array(values) for name, values in columns.items()}


def _name_and_unit(cell):
    match = re.fullmatch(r"\s*(.*?)\s*(?:\[(.*)\])?\s*", cell, re.S)
    return match[1], (match[2] or "").strip()


def _value(cell, unit, kind, where, key):
    try:
        return kind.parse(f"{cell.strip()} {unit}" if unit else float(cell))
    except ValueError:
        wanted = f"a number for {kind.expected}"
        raise at_key(key, f"{where} holds {cell.strip()!r}; expected {wanted}", cell, wanted) from None
