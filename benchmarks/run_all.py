"""All benchmarks, one after the other; ``benchmarks/README.md`` is written anew from what they measure.

    python3 benchmarks/run_all.py
"""

from __future__ import annotations

import io
from contextlib import redirect_stdout

import billet
import closest_point
import contact
import elastic_dies
import heat
import remeshing
import work_precision
from precision.measuring import FRONT

TEXT = """# Benchmarks

Written by `make bench`; the numbers come from one run, one process, one thread. Seconds depend on the machine and on
what else it does: compare rows with one another, not with another machine.

The page has, in this order: what accuracy costs in ten cases (`precision/`: a table and a picture each), the billet in more
detail, and the parts that a scene may have: new meshes, heat, contact between bodies, dies that deform, surfaces of tools.
[PEERS.md](PEERS.md) compares with CalculiX in the same way (`make peers`, on the host, where it is installed);
[PROFILE.md](PROFILE.md) says where the time goes and what was tried to make it less; `profiling.py`, `solver3d.py` and
`shifting.py` are run by themselves.

## What accuracy costs

Every row of a table is a run; its error is that against an exact solution, a converged value, or (strip, rod, block) a
finer run made here. *Default*: what the package does if the user says no more than the sizes of elements and steps named.
*Default over fastest*: its CPU time over that of the fastest run in the diagram that is no less exact; up to {front:g}
counts as on the front, and errors below 0.1 % as equal. Runs of less than half a second are made twice and the faster
counts. Elements are the same throughout, quadratic velocities with linear pressures, curved: no other pair is in the
package.

{precision}

## The billet in detail

*Force, to the finest*: the largest deviation of the die force at 10, 20 … 60 % from the last row, a finer run by the
midpoint scheme. *To the reference*: from the rigid-plastic values in `demos/billet_upsetting.py`. *Ratio*: CPU time in
units of the fastest run. *Volume*: drift over the whole run. *Outside assembly and solve*: part of the wall time that
is spent neither on assembling matrices nor on factorising and solving them.

How to read it: whenever a side folds onto a die the force moves, by about half a per cent on a mesh of 1 mm, and meshes
differ in where they are when; below a step of 0.45 mm (20 steps) that is all that is left, and only a finer mesh makes it
smaller. Longer steps let sides land early in the last third, which adds to the force. The explicit scheme looks better
than it is: it loses up to 3 % of the volume, which lowers the force and hides part of this error; its radius shows it. A
run that says *failed* ended before 60 %, however short its steps were made.

{billet}

## Renewing the mesh

`remesh = true`, everything else as in the scenes. *Remeshing and transfer*: part of the wall time, without the spaces,
forms and the solve on the new mesh, which belong to the steps; in the plane the spaces and forms take about as long.
*Largest jump*: of the die force at one and the same instant, before and after a remeshing.

{remeshing}

## Dies that take heat

The hot billet of `demos/hot_forging.py` to 24 mm, elements of 0.5 mm at the dies; runs differ in the upper die. *Heat*:
wall time of all that belongs to heat. A column stands for the finest temperature field within 0.2 % of the
heat, at a fraction of its time; elements of 1 mm in the die are too thick for what heat goes deep in 70 ms.

{heat}

## Contact between bodies

A billet cut into two that stick, against the billet in one piece, over penalty factors of which the default is 10; then one
step of two blocks in space, and the part of its CPU time that contact between them takes: search, gap operator, law,
forces, tangents, and what the iterative solver does with the gap operator on all of its levels.

{contact}

## Dies that deform

A strip of 12 mm pressed by 30 % between rigid and between elastic dies, in the same steps; the die has four times the
unknowns of the strip and is condensed to the nodes that contact reaches.

```
{elastic_dies}
```

## Closest points on tools

20 000 points within 2 % of the surface, one thread: time to build the surface, points per second, and how far the
distances are from those to the round body that the pieces stand for.

```
{closest_point}
```
"""


def main() -> None:
    """Measure, and write the page."""
    precision, measured = work_precision.main(), billet.main()
    with redirect_stdout(io.StringIO()) as table:
        closest_point.main()
    with redirect_stdout(io.StringIO()) as dies:
        elastic_dies.main()
    page = TEXT.format(precision=precision, front=FRONT, billet=measured, remeshing=remeshing.main(),
                       contact=contact.main(), heat=heat.main(), elastic_dies=dies.getvalue().strip(),
                       closest_point=table.getvalue().strip())
    (billet.HERE / "README.md").write_text(page, encoding="utf-8")
    print(page)


if __name__ == "__main__":
    main()
