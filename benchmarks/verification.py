"""The verification page: every comparison with REFERENCES.md that the tests make, as one table.

    python3 benchmarks/verification.py      # runs tests/verification, writes docs/VERIFICATION.md; some minutes

A test names the entry of docs/REFERENCES.md by its fixture ``verified`` (tests/conftest.py), which also checks it.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE, REFERENCES = ROOT / "docs" / "VERIFICATION.md", ROOT / "docs" / "REFERENCES.md"
MISSING = ROOT / "benchmarks" / "unverified.json"       # entry → why nothing is compared with it


def records(folder: Path) -> list[dict]:
    """The comparisons that a run of the tests has left, in the order of REFERENCES.md, each once."""
    lines = [json.loads(line) for file in sorted(folder.glob("*.jsonl")) for line in file.read_text().splitlines()]
    unique = {(line["entry"], line["what"]): line for line in lines}
    return sorted(unique.values(), key=lambda line: [int(part) for part in line["entry"].split(".")])


def headings() -> dict[str, str]:
    """Number of an entry or section in REFERENCES.md → its title."""
    found = re.findall(r"^##+ (\d+(?:\.\d+)?) ([^—:(\n]+)", REFERENCES.read_text(encoding="utf-8"), re.MULTILINE)
    return {number: title.strip() for number, title in found}


def entries() -> list[str]:
    """Numbers of the entries of REFERENCES.md that hold numbers: those with a heading, and sections without any."""
    numbers, experiments = [*headings()], "13"          # what is known of published experiments: nothing to compare with
    return [n for n in numbers if "." in n or (n != experiments and not any(m.startswith(f"{n}.") for m in numbers))]


def left_out(text: str) -> list[str]:
    """Entries that a page has no line for."""
    return [entry for entry in entries() if f"\n| {entry} | " not in text]


def page(lines: list[dict]) -> str:
    """The page, in Markdown."""
    titles, missing = headings(), json.loads(MISSING.read_text(encoding="utf-8"))
    met = sum(line["met"] for line in lines)
    text = ["# Verification", "",
            "Made by `python3 benchmarks/verification.py` from the tests themselves; entries and tolerances are those of",
            f"[REFERENCES.md](REFERENCES.md). {met} of {len(lines)} comparisons are within their tolerance.", ""]
    for section in sorted({line["entry"].split(".")[0] for line in lines} | {e.split(".")[0] for e in missing}, key=int):
        text += [f"## {section} {titles.get(section, '')}", "",
                 "| entry | what | ours | reference | deviation | allowed | |", "|---|---|---|---|---|---|---|"]
        text += [_row(line) for line in lines if line["entry"].split(".")[0] == section]
        text += [f"| {entry} | *{titles.get(entry, '')}: {why}* | | | | | – |" for entry, why in missing.items()
                 if entry.split(".")[0] == section]
        text.append("")
    return "\n".join(text)


def _row(line: dict) -> str:
    unit = f" {line['unit']}" if line["unit"] else ""
    if line["absolute"]:
        deviation, allowed = f"{line['deviation']:+.2g}{unit}", f"{line['within']:.2g}{unit}"
    else:
        deviation, allowed = f"{line['deviation']:+.2%}", f"{line['within']:.2%}"
        if abs(line["deviation"]) < 5e-5:
            deviation = f"{line['deviation']:+.0e}"
        if line["within"] < 5e-5:
            allowed = f"{line['within']:.0e}"
    return (f"| {line['entry']} | {line['what']} | {line['ours']:.6g}{unit} | {line['reference']:.6g} | {deviation} | "
            f"{allowed} | {'met' if line['met'] else '**not met**'} |")


def main() -> int:
    """Run the tests and write the page; the exit code of the tests."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["-m", "pytest", "-q", "-n", "2", "-m", "long or not long", f"--records={folder}", "tests/verification"]
        code = subprocess.run([sys.executable, *words], cwd=ROOT).returncode
        PAGE.write_text(page(records(Path(folder))), encoding="utf-8")
    return code


if __name__ == "__main__":
    raise SystemExit(main())
