"""Work-precision diagrams of nine cases: error against CPU time for schemes, elements, steps and modes.

    python3 benchmarks/work_precision.py                  # all, some five minutes
    python3 benchmarks/work_precision.py taylor block     # these alone

Tables and pictures go to ``benchmarks/precision/``. Every error is that against an exact solution or against a finer run
made here; times are CPU seconds of one process, after a first run that compiles; ratios carry over to other machines.
"""

from __future__ import annotations

import sys
from time import perf_counter

from precision import billet as billets
from precision import block as blocks
from precision import coupling, cylinder, extrusion, half_space, homogeneous, platens, taylor
from precision.measuring import draw, rows_of, verdict, write

CASES = (homogeneous.CASE, billets.CASE, platens.CASE, extrusion.CASE, cylinder.CASE, coupling.COLUMN, coupling.STRIP,
         taylor.CASE, half_space.CASE, blocks.CASE)


def summary(found: list[tuple]) -> str:
    """What the defaults cost, and the pictures."""
    text = ["| case | default | error | CPU s | fastest that is no less exact | default over fastest |",
            "| --- | --- | ---: | ---: | --- | ---: |"]
    for case, rows in found:
        text += [f"| {case.name.replace('_', ' ')} | {row['series']}, {row['setup']} | {100 * row['error']:.2g} % | "
                 f"{row['cpu_s']:.2f} | {row['fastest']} | {row['times_the_fastest']:.1f} |" for row in verdict(rows)]
    for case, _ in found:
        text += ["", f"### {case.title}", "", f"{case.reading} [Numbers](precision/{case.name}.csv).", "",
                 f"![error against CPU time and against {case.along}](precision/{case.name}.png)"]
    return "\n".join(text)


def main(names=()) -> str:
    """Run the cases, write tables and pictures; the Markdown of the summary."""
    found = []
    for case in CASES:
        if names and case.name not in names:
            continue
        began = perf_counter()
        rows = rows_of(case)
        write(rows, case.name)
        draw(case, rows)
        found.append((case, rows))
        print(f"{case.name}: {len(rows)} runs, {perf_counter() - began:.0f} s", file=sys.stderr, flush=True)
    return summary(found)


if __name__ == "__main__":
    print(main(sys.argv[1:]))
