"""The page of comparisons with REFERENCES.md leaves no entry out, and says nothing that the tests no longer say."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def verification():
    """The program by its path: the folder of tests has its name too."""
    there = importlib.util.spec_from_file_location("page_of_comparisons", ROOT / "benchmarks" / "verification.py")
    program = importlib.util.module_from_spec(there)
    there.loader.exec_module(program)
    return program


def test_every_entry_of_the_references_is_compared_or_has_its_reason(verification):
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests" / "verification").glob("*.py"))
    compared = set(re.findall(r'verified\(\s*"(\d+)"|"(\d+\.\d+)"', tests))      # entries with a point are also handed over
    compared = {number for pair in compared for number in pair}
    missing = json.loads(verification.MISSING.read_text(encoding="utf-8"))
    assert len(verification.entries()) > 45
    assert [entry for entry in verification.entries() if entry not in compared | set(missing)] == []
    assert all(len(reason) > 5 for reason in missing.values())


def test_the_page_as_it_is_leaves_no_entry_out(verification):
    assert verification.left_out(verification.PAGE.read_text(encoding="utf-8")) == []


def test_an_entry_that_is_not_on_the_page_is_found(verification):
    text = verification.PAGE.read_text(encoding="utf-8")
    without = "\n".join(line for line in text.splitlines() if not line.startswith("| 8.6 |"))
    assert verification.left_out(without) == ["8.6"]
