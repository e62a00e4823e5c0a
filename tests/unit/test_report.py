"""The report of a run is one page that needs nothing beside it and holds what one asks of a run."""

import json
from html.parser import HTMLParser

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.cli import main
from fenics_forming.results import page
from fenics_forming.results.report import key_figures, report

pytest.importorskip("matplotlib").use("Agg")

VOID = {"meta", "img", "br", "link", "input"}


class Reader(HTMLParser):
    """Checks that tags close in order, and gathers sources, links and text."""

    def __init__(self, text):
        super().__init__()
        self.open, self.sources, self.anchors, self.ids, self.words = [], [], [], [], []
        self.feed(text)
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.sources += [attrs[key] for key in ("src", "href") if key in attrs and tag != "a"]
        self.anchors += [attrs["href"]] if tag == "a" else []
        self.ids += [attrs["id"]] if "id" in attrs else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    scene = ff.Scene(
        title="A <billet> & its platen", geometry="axisymmetric", materials={"m": {"from": "steel_1006"}},
        workpieces={"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 15]}, "material": "m",
                               "symmetry": ["z"], "mesh_size": 4, "temperature": 20}},
        tools={"upper": {"shape": {"kind": "plane", "point": [0, 15], "normal": [0, -1]},
                         "drive": {"kind": "speed", "velocity": [0, -1]}, "friction": ff.laws.Siebel(factor=0.3)}},
        points={"equator": {"body": "billet", "at": [10, 0]}}, steps={"stroke": 1}, stop={"stroke": 2})
    return ff.simulate(scene, tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def text(run):
    return report(run)


def test_the_page_is_whole_and_needs_nothing_beside_it(text):
    read = Reader(text)
    assert read.sources and all(source.startswith("data:image/") for source in read.sources)
    assert {anchor.removeprefix("#") for anchor in read.anchors} == set(read.ids)
    assert "A <billet> & its platen" in read.words, "what the user wrote is escaped"


def test_it_holds_scene_figures_curves_pictures_ledgers_and_the_reason_of_its_end(text):
    words = " ".join(Reader(text).words)
    for title in ("Key figures", "Curves", "Pictures", "Ledgers", "Steps", "Where the time went", "Scene", "Made with"):
        assert f">{title}</h2>" in text
    assert "stroke 2 mm reached" in words and 'from = "steel_1006"' in words
    assert "by: integration" in words and "contact pressure along the surface" in words
    assert "temperature" not in [w for w in Reader(text).words], "the same everywhere: no picture of it"


def test_key_figures_are_those_of_the_history(run):
    figures = dict(key_figures(run))
    rows = run.history.rows
    assert figures["stroke of upper"] == "2 mm"
    assert figures["largest force of upper"] == f"{max(r['force_upper_N'] for r in rows) / 1e3:.4g} kN"
    work = np.trapezoid(run.force(), run.stroke()) / 1000
    assert figures["work of upper"] == f"{work:.4g} J"


def test_strains_beyond_the_data_of_a_material_are_a_warning(run, text):
    assert ">Warnings</h2>" not in text
    history = ff.History()
    for row in run.history.rows:
        history.append({**row, "max_effective_strain": 3.0})
    del history.rows[:-1]                    # one row: no diagrams are drawn
    beyond = ff.Results(None, scene=run.scene, history=history, summary=run.summary)
    assert "reaches 3; the data of &#x27;steel_1006&#x27; go to 1" in report(beyond)


def test_a_failed_run_or_one_that_goes_on_has_its_page_too(run, tmp_path):
    failed = ff.Results(None, scene=run.scene, history=ff.History(),
                        summary={"stopped": "failed: no step", "warnings": ["a fold"]})
    text = report(failed)
    assert 'class="badge bad"' in text and "a fold" in text
    Reader(text)
    assert 'class="badge open">not ended' in report(ff.Results(None, scene=run.scene, history=ff.History(), summary={}))


def test_the_command_line_writes_it(run, tmp_path, capsys):
    assert main(["report", str(run.folder), "--out", str(tmp_path / "page.html")]) == 0
    assert (tmp_path / "page.html").stat().st_size > 50_000
    assert capsys.readouterr().out.strip().endswith("page.html")
    assert main(["plot", str(run.folder), str(run.folder), "--out", str(tmp_path / "two.png")]) == 0
    assert (tmp_path / "two.png").stat().st_size > 5000
    assert main(["report", str(tmp_path)]) == 2
    assert "holds no results" in capsys.readouterr().err


@pytest.mark.parametrize("value, text", [(0.0, "0"), (12345.0, "12345"), (-1.5, "\N{MINUS SIGN}1.5"), (float("nan"), "—"),
                                         (3.2e-7, "3.2·10⁻⁷"), (9.841e5, "9.841·10⁵"), (True, "yes")])
def test_numbers_read_well(value, text):
    assert page.number(value) == text


def test_tables_escape_what_they_show():
    assert page.table([["<a>", 1.0]]) == ('<div class="scroll"><table><tr><td>&lt;a&gt;</td><td class="n">1</td></tr>'
                                          "</table></div>")
    assert page.table([]) == "" and page.bullets([]) == "" and page.bars({}, "s") == ""
    assert json.dumps(page.address(b"x", "image/png"))


def test_sentences_are_broken_between_words_on_a_terminal_and_nowhere_else(monkeypatch):
    from io import StringIO

    from fenics_forming.errors import as_lines

    class Terminal(StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv("COLUMNS", "40")
    text = "tools.upper.drive.velocty: is not a key here; did you mean 'velocity'?\nshort"
    lines = as_lines(text, Terminal()).splitlines()
    assert max(map(len, lines)) <= 40 and " ".join(line.strip() for line in lines) == text.replace("\n", " ")
    assert lines[1].startswith("  ") and lines[-1] == "short"
    assert as_lines(text, StringIO()) == text
