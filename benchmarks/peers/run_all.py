"""The same jobs by CalculiX and by this package, in one run: CPU seconds and errors of both.

    python3 benchmarks/peers/run_all.py              # on the host, beside env/run; some minutes
    python3 benchmarks/peers/run_all.py ring block   # these cases alone
    python3 benchmarks/peers/run_all.py --long       # also the runs of CalculiX that take minutes

Rows that are not run again stay as they are in ``benchmarks/peers.csv``. Only one of the two runs at a time, on one thread.
An error is the largest deviation from the reference of the case, over its stations and over force and radii (or pressure).
"""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import calculix
from block import Block
from shrink_fit import ShrinkFit
from upsetting import Upsetting

ROOT, HERE = Path(__file__).resolve().parents[2], Path(__file__).resolve().parent
TABLE, PAGE = HERE.parent / "peers.csv", HERE.parent / "PEERS.md"
COLUMNS = ("case", "code", "setup", "cpu_s", "peak_mb", "unknowns", "error", "reached", "found")
LINEAR, PERFECT = ((700, 0), (1900, 4)), ((700, 0), (700.001, 4))
LIMIT = 1200.0      # CPU seconds of one run of CalculiX
LONG = 60.0         # from here on a run is made on demand only


def billet(cells, contact="NODE TO SURFACE", increment=0.01, friction="bonded"):
    return Upsetting(0.0, 10.0, 15.0, 0.6, LINEAR, cells, friction, contact=contact, increment=increment,
                     penalty=1e6, stick=1e5)


def ring(cells, friction, increment=0.01):
    return Upsetting(4.5, 9.0, 3.0, 0.4, PERFECT, cells, friction, increment=increment, penalty=1e6, stick=1e5, stations=4)


def cells(*number) -> str:
    return " x ".join(map(str, number))


# case → name of the setup → (what is run, whether it takes minutes)
CALCULIX = {
    "billet": {
        **{f"CAX8R {cells(*n)}, nodes to surface": (billet(n), n[0] > 12) for n in ((6, 9), (8, 12), (12, 18), (16, 24))},
        "CAX8R 8 x 12, surface to surface": (billet((8, 12), "SURFACE TO SURFACE"), False),
        "CAX8R 16 x 24, surface to surface": (billet((16, 24), "SURFACE TO SURFACE"), True)},
    "smooth_ring": {f"CAX8R {cells(*n)}": (ring(n, 0.0), n[0] > 16) for n in ((8, 6), (16, 12), (32, 24))},
    "ring": {f"CAX8R {cells(*n)}": (ring(n, 0.1), n[0] > 16) for n in ((8, 6), (16, 12), (32, 24), (48, 36))},
    **{case: {f"C3D20R {cells(n, n, n)}": (Block(n, reduction=0.1 * way, stations=way, increment=0.02), n > 8)
              for n in (4, 6, 8, 12)} for case, way in (("block", 1), ("block_20", 2), ("block_30", 3))},
    "shrink_fit": {f"CAX8, {n} over the wall of the liner": (ShrinkFit(n), False) for n in (16, 32, 64)}}


# ---------------------------------------------------------------------- references
def smooth(station: int) -> dict:
    """Homogeneous compression of the ring: exact."""
    height = 1 - 0.1 * station
    return {"force_kN": 700e-3 * 3.141592653589793 * (81 - 20.25) / height, "radius_mm": 9 / height**0.5,
            "bore_mm": 4.5 / height**0.5}


RIGID = (261.7, 307.4, 366.1, 449.6, 585.0, 864.0)      # kN at 10 … 60 %, converged
ELASTIC = (261.0, 306.0, 364.0, 448.0, 582.0, 854.0)    # with elasticity, REFERENCES.md 3.3


def references(case: str, code: str, finest: dict) -> list[dict]:
    """Station → what should be found, as one or more possibilities of which the closest counts."""
    if case == "billet":
        tables = [RIGID] if code == "ours" else [RIGID, ELASTIC]        # CalculiX has elasticity: the better for it
        return [{k + 1: {"force_kN": force} for k, force in enumerate(table)} for table in tables]
    if case == "smooth_ring":
        return [{k: smooth(k) for k in range(1, 5)}]
    if case == "shrink_fit":
        return [{1: {"pressure_MPa": ShrinkFit(1).pressure}}]
    return [finest]


def error(found: dict, possible: list[dict]) -> float | None:
    """Largest relative deviation over stations and numbers."""
    def deviation(station, name, value):
        return min(abs(value / one[station][name] - 1) for one in possible)

    return max((deviation(station, name, value) for station, values in found.items() for name, value in values.items()
                if name in possible[0].get(station, {})), default=None)


def limit_of(rows: list[dict]) -> dict:
    """What a sequence of meshes tends to: of first order in the element size, by a straight line through all of them; the
    sticking edge is singular. ``setup`` begins with the size, or says how many elements there are along 15 mm."""
    def size(row):
        return float(row["setup"].split(" mm")[0]) if row["code"] == "ours" else 15.0 / float(row["setup"].split()[1])

    sizes = [size(row) for row in rows]
    return {station: {name: intercept(sizes, [row["stations"][station][name] for row in rows])
                      for name in rows[0]["stations"][station]} for station in rows[0]["stations"]}


def intercept(x: list[float], y: list[float]) -> float:
    """Value at 0 of the straight line closest to the points."""
    middle, mean = sum(x) / len(x), sum(y) / len(y)
    slope = sum((a - middle) * (b - mean) for a, b in zip(x, y, strict=True)) / sum((a - middle) ** 2 for a in x)
    return mean - slope * middle


# ---------------------------------------------------------------------- running
def by_calculix(case: str, long: bool, kept: list[dict]) -> list[dict]:
    """Runs of one case; long ones are taken from the table unless they are asked for."""
    rows = []
    for setup, (job, is_long) in CALCULIX[case].items():
        old = [row for row in kept if (row["case"], row["code"], row["setup"]) == (case, "CalculiX", setup)]
        if is_long and not long:
            rows += old
            continue
        folder = Path(tempfile.mkdtemp(prefix="peer_"))
        done = job.run(folder, LIMIT)
        shutil.rmtree(folder)
        rows.append({"case": case, "code": "CalculiX", "setup": setup, "cpu_s": done["cpu_s"], "peak_mb": done["peak_mb"],
                     "unknowns": "", "stations": done["stations"],
                     "reached": 1.0 if done["finished"] else done["reduction_reached"] / getattr(job, "reduction", 1.0)})
        shown(rows[-1])
    return rows


def by_us(case: str) -> list[dict]:
    """Our runs of one case."""
    words = [str(ROOT / "env" / "run"), "python3", str(HERE / "ours.py"), case]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"our own {case} failed: {done.stderr.strip().splitlines()[-1]}")
    rows = []
    for line in done.stdout.splitlines():
        if line.startswith("{"):
            row = json.loads(line)
            rows.append({"case": case, "code": "ours", "setup": row["setup"], "cpu_s": row["cpu_s"], "peak_mb": "",
                         "unknowns": row["unknowns"], "reached": 1.0,
                         "stations": {int(k): v for k, v in row["stations"].items()}})
            shown(rows[-1])
    return rows


def shown(row: dict) -> None:
    print(f"{row['case']} {row['code']} {row['setup']} {row['cpu_s']:.2f} s {row['reached']:.0%}", flush=True)


def judged(rows: list[dict]) -> list[dict]:
    """The rows of one case with their errors."""
    case, sides = rows[0]["case"], {}
    for code in ("CalculiX", "ours"):
        whole = [row for row in rows if row["code"] == code and row["reached"] == 1.0]
        finest = {} if not whole else limit_of(whole) if case.startswith("block") else whole[-1]["stations"]
        sides[code] = references(case, code, finest)
    if case in ("ring", "block_30"):        # they end one to six per cent apart: for CalculiX the nearer one counts
        sides["CalculiX"] += sides["ours"]
    return [row | {"error": error(row["stations"], sides[row["code"]])} for row in rows]


# ---------------------------------------------------------------------- table and page
def read() -> list[dict]:
    """The rows of the table as they were written."""
    if not TABLE.exists():
        return []
    with TABLE.open(encoding="utf-8") as file:
        return [row | {"stations": {int(k): v for k, v in json.loads(row["found"]).items()}, "cpu_s": float(row["cpu_s"]),
                       "reached": float(row["reached"]), "error": float(row["error"]) if row["error"] else None}
                for row in csv.DictReader(file)]


def write(rows: list[dict]) -> None:
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n", extrasaction="ignore")
        table.writeheader()
        for row in rows:
            found = {k: {n: round(v, 4) for n, v in values.items()} for k, values in row["stations"].items()}
            peak = f"{float(row['peak_mb']):.0f}" if row["peak_mb"] else ""
            table.writerow(row | {"found": json.dumps(found), "cpu_s": f"{row['cpu_s']:.3f}", "peak_mb": peak,
                                  "error": "" if row["error"] is None else f"{row['error']:.6f}",
                                  "reached": f"{row['reached']:.3f}"})


TITLES = {"billet": "Billet to 60 % between rough dies, sides fold onto them",
          "smooth_ring": "Ring 18 : 9 : 6 mm to 40 % without friction", "ring": "The ring with Coulomb friction 0.1",
          "block": "One eighth of a cube of 30 mm by 10 % between sticking plates",
         "block_20": "The cube by 20 %, plates no larger than the faces: no side folds",
         "block_30": "The cube by 30 % between these plates",
          "shrink_fit": "Two rings shrunk together"}


def page(rows: list[dict]) -> str:
    """Tables: every run, and for each of CalculiX the fastest of ours that is no less exact."""
    text = [(HERE / "page.md").read_text(encoding="utf-8").rstrip(), ""]
    for case, title in TITLES.items():
        of_case = [row for row in rows if row["case"] == case]
        ours = [row for row in of_case if row["code"] == "ours"]
        text += [f"## {title}", "", "| code | set-up | CPU s | error | ours at no larger error | ratio of CPU times |",
                 "|---|---|---:|---:|---|---:|"]
        for row in of_case:
            ended = row["reached"] > 0.999
            wrong = f"{100 * row['error']:.2f} %" if ended else f"stops at {100 * row['reached']:.0f} % of the way"
            if case == "ring" and row["error"] == 0.0:
                wrong = "reference"
            as_good = [one for one in ours if not ended or one["error"] <= row["error"]] \
                if row["code"] != "ours" and wrong != "reference" else []
            best = min(as_good, key=lambda one: one["cpu_s"], default=None)
            compared = " | "
            if best:
                compared = (f"{best['setup']}: {best['cpu_s']:.2f} s, {100 * best['error']:.2f} % | "
                            f"{row['cpu_s'] / best['cpu_s']:.1f}")
            text.append(f"| {row['code']} | {row['setup']} | {row['cpu_s']:.2f} | {wrong} | {compared} |")
        text.append("")
    return "\n".join(text)


def main(words: list[str]) -> None:
    """Run, write the table and the page."""
    if not calculix.is_there():
        print("CalculiX is not installed here (Debian 12: apt install calculix-ccx); the comparison is left out.")
        return
    asked = [word for word in words if word in TITLES] or list(TITLES)
    kept, rows = read(), []
    for case in TITLES:
        if case in asked:
            rows += judged(by_us(case) + by_calculix(case, "--long" in words, kept))
        else:
            rows += [row for row in kept if row["case"] == case]
    write(rows)
    PAGE.write_text(page(rows), encoding="utf-8")
    print(PAGE.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main(sys.argv[1:])
