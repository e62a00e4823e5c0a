"""Input decks for CalculiX, its runs, and the numbers they print. Standard library only: this runs on the host.

CalculiX (Dhondt and Wittig) is started as ``ccx``; Debian 12 has it as ``calculix-ccx``. Axisymmetric
elements are a sector of two degrees to it: forces are printed for that, and are 180 times as large for the full circle.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

SECTORS = 180       # of axisymmetric elements in the circle
# corners of a quadrilateral, then of a hexahedron, in units of half a cell, and the nodes on their edges
QUADRILATERAL = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
HEXAHEDRON = (*((x, y, 0) for x, y in QUADRILATERAL[:4]), *((x, y, 2) for x, y in QUADRILATERAL[:4]),
              *((x, y, 0) for x, y in QUADRILATERAL[4:]), *((x, y, 2) for x, y in QUADRILATERAL[4:]),
              *((x, y, 1) for x, y in QUADRILATERAL[:4]))


def is_there() -> bool:
    """Whether CalculiX can be started."""
    return shutil.which("ccx") is not None


@dataclass
class Deck:
    """Nodes, elements and cards of an input deck."""

    nodes: list = field(default_factory=list)
    elements: int = 0
    cards: list = field(default_factory=list)

    def grid(self, name: str, kind: str, low, high, cells) -> dict:
        """Regular quadratic elements of a rectangle or a box; the node number at every (i, j[, k]) in half cells."""
        corners = QUADRILATERAL if len(cells) == 2 else HEXAHEDRON
        numbers: dict[tuple, int] = {}
        lines = []
        for cell in _product([range(n) for n in cells]):
            keys = [tuple(2 * c + o for c, o in zip(cell, offset, strict=True)) for offset in corners]
            for key in keys:
                if key not in numbers:
                    self.nodes.append([a + (b - a) * k / (2 * n) for a, b, k, n in zip(low, high, key, cells, strict=True)])
                    numbers[key] = len(self.nodes)
            self.elements += 1
            lines.append([self.elements, *(numbers[key] for key in keys)])
        self.cards += [f"*ELEMENT,TYPE={kind},ELSET={name}", *_wrapped(lines)]
        return numbers

    def node_set(self, name: str, numbers) -> None:
        self.cards += [f"*NSET,NSET={name}", *_wrapped([sorted(set(numbers))])]

    def add(self, *cards: str) -> None:
        self.cards += cards

    def write(self, path: Path) -> None:
        nodes = [f"{k + 1}," + ",".join(f"{x:.12g}" for x in (*p, 0.0)[:3]) for k, p in enumerate(self.nodes)]
        path.write_text("\n".join(["*NODE,NSET=ALL", *nodes, *self.cards]) + "\n")


def elastic_plastic(name: str, young: float, poisson: float, curve=()) -> list[str]:
    """Cards of a material; ``curve`` is pairs of true stress and plastic strain."""
    plastic = ["*PLASTIC", *(f"{stress},{strain}" for stress, strain in curve)] if curve else []
    return [f"*MATERIAL,NAME={name}", "*ELASTIC", f"{young:g},{poisson:g}", *plastic]


@dataclass
class Run:
    """What a run has cost and where it ended."""

    finished: bool
    cpu_s: float
    peak_mb: float
    text: str

    def total_forces(self, *names: str) -> dict[float, list[float]]:
        """Time → sum over node sets of the total forces printed with TOTALS=ONLY."""
        found: dict[float, list[float]] = {}
        pattern = r"total force \(fx,fy,fz\) for set (\S+) and time +(\S+)\s+([^\n]+)"
        for name, time, values in re.findall(pattern, self.text):
            if name in names:
                one = [float(v) for v in values.split()]
                found[float(time)] = [a + b for a, b in zip(found.get(float(time), [0.0] * 3), one, strict=True)]
        return found

    def printed(self, what: str, name: str) -> dict[float, list[list[float]]]:
        """Time → lines of numbers that were printed for a set: node or element number first."""
        found = {}
        pattern = rf"{what} \([^)]*\) for set {name} and time +(\S+)\s+((?: +\d+ [^\n]+\n?)+)"
        for time, block in re.findall(pattern, self.text):
            found[float(time)] = [[float(v) for v in line.split()] for line in block.splitlines() if line.strip()]
        return found


def run(deck: Deck, folder: Path, limit: float) -> Run:
    """Run a deck for at most ``limit`` CPU seconds, on one thread; its files stay in the folder."""
    deck.write(folder / "job.inp")
    with (folder / "job.out").open("w") as out:
        process = subprocess.Popen(["ccx", "job"], cwd=folder, stdout=out, stderr=out,
                                   env=os.environ | {"OMP_NUM_THREADS": "1"},
                                   preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit),) * 2))
        _, status, used = os.wait4(process.pid, 0)      # what this child alone has used
    process.returncode = os.waitstatus_to_exitcode(status)
    printed = folder / "job.dat"
    return Run(process.returncode == 0, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3,
               printed.read_text() if printed.exists() else "")


def _product(ranges):
    if not ranges:
        yield ()
        return
    for tail in _product(ranges[1:]):
        for first in ranges[0]:
            yield (first, *tail)


def _wrapped(rows, width: int = 14) -> list[str]:
    """Rows of integers as lines of at most ``width``, which continue after a comma."""
    lines = []
    for row in rows:
        pieces = [row[k:k + width] for k in range(0, len(row), width)]
        lines += [",".join(map(str, piece)) + ("," if piece is not pieces[-1] else "") for piece in pieces]
    return lines
