"""What a verification test compares with REFERENCES.md is checked, and kept for the verification page on demand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest


def pytest_addoption(parser):
    parser.addoption("--records", metavar="FOLDER", help="write what is compared with REFERENCES.md there, a line each")


@pytest.fixture
def verified(request):
    """Check a value against an entry of REFERENCES.md: ``verified("4.1", "smooth punch", ours, reference, within=0.02)``.

    entry : number in REFERENCES.md · what : a few words · within : the deviation allowed, of the reference, or in ``unit``
    if ``absolute`` · unit : of both numbers. Several numbers are as many lines, told apart by the list ``at``.
    """
    def check(entry, what, ours, reference, *, within, unit="", absolute=False, at=None):
        if at is not None:
            for place, mine, theirs in zip(at, ours, reference, strict=True):
                check(entry, f"{what}, {place}", mine, theirs, within=within, unit=unit, absolute=absolute)
            return
        off = float(ours) - float(reference)
        deviation = off if absolute else off / abs(float(reference))
        met = abs(deviation) <= within
        folder = request.config.getoption("--records")
        if folder is not None:
            line = {"entry": entry, "what": what, "ours": float(ours), "reference": float(reference), "unit": unit,
                    "deviation": deviation, "within": within, "absolute": absolute, "met": met,
                    "test": request.node.nodeid}
            worker = getattr(request.config, "workerinput", {}).get("workerid", "main")
            with Path(folder, f"{worker}.jsonl").open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
        size = f"{deviation:+.3g} {unit}" if absolute else f"{deviation:+.3%}"
        assert met, f"REFERENCES {entry}, {what}: {ours:.6g} for {reference:.6g} {unit}, {size}; allowed {within:g}"

    return check
