"""`bench figures`: what it prints and writes, with pages made here; test_readme.py runs the real ones."""

import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from pipeline.accuracy.plots import png
from pipeline.errors import AccuracyError
from pipeline.evaluation.check import Check
from pipeline.evaluation.figures import bench
from pipeline.evaluation.figures.page import Bench, Column, Page, PageTable, Picture
from tests.cli.tool import REPOSITORY, Tool, recipe, too_wide


class Links(HTMLParser):
    """The addresses that a page leads to."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "a":
            self.found += [value for name, value in attrs if name == "href" and value]


def picture() -> bytes:
    from matplotlib.figure import Figure as Drawing

    drawing = Drawing(figsize=(1, 1))
    drawing.subplots().plot([0, 1], [0, 1])
    return png(drawing)


def first(bench: Bench, _progress: object) -> Page:
    checks = [
        Check("samples", "samples", bench.elaphe.field.heights_um.size, ">", 0),
        Check("tag", "a <tag> & more", 2, "<", 1, source="closed form"),
        Check("published", "published", 40, "=", 39),
    ]
    rows = [("1", np.float64(1.25), (np.float32(0.5), np.inf))]
    table = PageTable("rows", "Rows", (Column("a"), Column("b", "{:.1f}"), Column("c", "{:g} to {:g}")), rows)
    return Page("first", "First", "[D14] fig. 1", "all well", checks, [table], [Picture(picture(), "a line")])


@pytest.fixture
def tool(tool: Tool, published: Path) -> Tool:
    """An empty folder, and the store that other tests left the bench's surfaces in."""
    return Tool(tool.folder, published)


@pytest.fixture
def one_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "PAGES", ("first",))

    class Module:
        make = staticmethod(first)

    monkeypatch.setattr(bench, "import_module", lambda _name: Module)


@pytest.mark.usefixtures("one_page")
def test_it_writes_a_page_a_figure_and_tells_verdicts(tool: Tool) -> None:
    result = tool("bench", "figures", "--quick")
    assert result.code == 0, result.stderr
    folder = tool.out / "figures"
    assert sorted(path.name for path in folder.iterdir()) == ["figures.json", "first.html", "index.html"]
    index, page = ((folder / name).read_text(encoding="utf-8") for name in ("index.html", "first.html"))
    assert "1 of 2 judged statements hold, 1 more are reported and not judged" in index
    for text in (index, page):
        links = Links()
        links.feed(text)
        assert links.found
        assert all((folder / address).is_file() for address in links.found)
        assert "a &lt;tag&gt; &amp; more" in text
    assert "data:image/png;base64," in page
    lines = result.stdout.splitlines()
    assert lines[1].split()[:4] == ["first", "1", "1", "1"]
    assert lines[2] == "first: a <tag> & more: expected < 1, measured 2"
    assert too_wide(result.stdout) == []
    document = json.loads((folder / "figures.json").read_text(encoding="utf-8"))
    assert document["pages"][0]["tables"] == {"rows": [{"a": "1", "b": 1.25, "c": [0.5, None]}]}
    checks = {check["id"]: check for check in document["pages"][0]["checks"]}
    assert {key: check["verdict"] for key, check in checks.items()} == {
        "samples": "holds",
        "tag": "misses",
        "published": "reported",
    }
    assert (checks["tag"]["source"], checks["published"]["source"]) == ("closed form", "[D14] fig. 1")


@pytest.mark.usefixtures("one_page")
def test_machines_get_one_document(tool: Tool) -> None:
    result = tool("bench", "figures", "--json")
    assert result.json["pages"][0]["name"] == "first"
    assert all((tool.folder / path).is_file() for path in result.json["files"])


@pytest.mark.usefixtures("one_page")
def test_a_config_stands_for_a_snake(tool: Tool) -> None:
    config = tool.config("mine.toml", name="mine")
    result = tool("bench", "figures", "--elaphe", config)
    assert result.code == 0, result.stderr
    assert "<td>&gt; 0</td><td>1e+04</td>" in (tool.out / "figures" / "first.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("one_page")
@pytest.mark.parametrize(
    ("changes", "code", "said"),
    [
        ({"name": "blazed"}, 2, "also the name of the surface for blazed"),
        ({"surface": recipe("mirror")}, 3, "got a flat one"),
    ],
)
def test_surfaces_that_say_nothing_are_refused_at_once(tool: Tool, changes: dict, code: int, said: str) -> None:
    result = tool("bench", "figures", "--elaphe", tool.config("odd.toml", **changes))
    assert (result.code, len(result.errors)) == (code, 1)
    assert said in result.errors[0]
    assert not (tool.out / "figures").exists()


@pytest.mark.usefixtures("one_page")
def test_a_laser_line_has_no_colours_to_compare(tool: Tool) -> None:
    config = tool.folder / "laser.toml"
    text = 'name = "laser"\n[surface]\nrecipe = { kind = "elaphe" }\n[spectrum]\nilluminant = { lambda_nm = 532 }\n'
    config.write_text(text, encoding="utf-8")
    result = tool("bench", "figures", "--xenopeltis", config)
    assert (result.code, len(result.errors)) == (2, 1)
    assert "got a laser line; see --xenopeltis" in result.errors[0]


@pytest.mark.usefixtures("one_page")
def test_a_page_that_cannot_be_made_takes_no_other_with_it(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_bench: Bench, _progress: object) -> Page:
        raise AccuracyError("too tall")

    class Refusing:
        make = staticmethod(refuse)

    modules = {
        "pipeline.evaluation.figures.first": bench.import_module("first"),
        "pipeline.evaluation.figures.tall_one": Refusing,
    }
    monkeypatch.setattr(bench, "PAGES", ("tall_one", "first"))
    monkeypatch.setattr(bench, "import_module", modules.__getitem__)
    result = tool("bench", "figures")
    assert result.code == 0, result.stderr
    assert "tall_one: page of these surfaces (too tall): expected ≥ 1, measured 0" in result.stdout
    assert (tool.out / "figures" / "first.html").is_file()


def test_every_page_is_there() -> None:
    folder = REPOSITORY / "pipeline" / "evaluation" / "figures"
    with_make = {path.stem for path in folder.glob("*.py") if "\ndef make(" in path.read_text(encoding="utf-8")}
    assert with_make == set(bench.PAGES)
