"""Page, terminal and JSON are renderings of one document: what must be heard is in all of them, wherever it stands."""

from __future__ import annotations

import ast
import html
import importlib
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

import expdesign.export
from expdesign.cli.commands import as_json, print_summary
from expdesign.export.document import (
    Block,
    Document,
    Figure,
    Gallery,
    Items,
    Listing,
    Mark,
    Note,
    Section,
    Table,
    Terms,
    fact_rows,
    filled,
    section,
)
from expdesign.export.pages import document_html
from expdesign.workflows.outcome import Outcome

EXPORT = Path(expdesign.export.__file__).parent
FIGURE = Figure(draw=lambda: "drawn", caption="What is drawn.")
BESIDE: tuple[Block, ...] = (
    "A paragraph.",
    Table(header=("A", "B"), rows=[("one\nof two lines", "two")]),
    FIGURE,
    replace(FIGURE, above=True),
    Gallery((FIGURE,), small=True, folded="Others"),
    Items(("An item.",)),
    Terms((("Word", "what it means"),)),
    Listing(("expdesign run a.toml",)),
    Note("Another <note> & more."),
)
WHOLE = Document(
    kind="A trial",
    title="story",
    about="A ship.",
    mark=Mark(text="not verified", good=False),
    findings=("The first finding.", "The second."),
    facts={"day_s": 3600.0, "runs": 12, "lost": {"first": 1}},
    values={"gap": float("nan")},
    notes=("ignored mood",),
    command="expdesign run a.toml",
)


def text_of(page: str) -> str:
    body = re.sub(r"<(style|script).*?</\1>", "", page, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub("<[^>]+>", " ", body)).split())


def renderings(document: Document, capsys: pytest.CaptureFixture[str]) -> Iterator[str]:
    outcome = Outcome(files=(), document=document)
    print_summary(outcome)
    yield text_of(document_html(document))
    yield " ".join(capsys.readouterr().out.split())
    yield " ".join(str(json.loads(as_json("run", outcome))).split())


@pytest.mark.parametrize("beside", BESIDE, ids=lambda block: type(block).__name__)
@pytest.mark.parametrize("level", [2, 3])
@pytest.mark.parametrize("of", ["", "ls"])
def test_a_note_beside_any_block_is_heard_everywhere(
    beside: Block, level: int, of: str, capsys: pytest.CaptureFixture[str]
) -> None:
    note = Note('A doubt, of "data" <and> more.', of)
    for blocks in ((note, beside), (beside, note), (note,)):
        part = Section(title="Part", blocks=blocks, level=level)  # type: ignore[arg-type]
        document = replace(WHOLE, sections=(section("Before", beside), *filled(part)))
        for told in renderings(document, capsys):
            assert note.text in told
            assert told.count(note.text) == 1


def test_every_kind_of_block_was_beside_it() -> None:
    kinds = {kind for kind in get_args(Block) if kind.__name__ != "Markup"}
    assert kinds == {type(block) for block in BESIDE}


def test_findings_facts_verdict_and_notes_are_in_all_renderings(capsys: pytest.CaptureFixture[str]) -> None:
    page, terminal, whole = renderings(WHOLE, capsys)
    for told in (page, terminal, whole):
        assert [text for text in (*WHOLE.findings, *WHOLE.notes, "not verified") if text not in told] == []
    assert dict(fact_rows(WHOLE.facts)) == {"day": "3600 s", "runs": "12", "lost, first": "1"}
    for label, value in fact_rows(WHOLE.facts):
        assert f"{label[0].upper()}{label[1:]} {value}" in page
        assert f"{label} {value}" in terminal
    assert json.loads(as_json("run", Outcome(files=(), document=WHOLE)))["summary"] == {**WHOLE.facts, "gap": None}


@pytest.mark.parametrize("nothing", [[], (), {}, "", None, float("nan")])
@pytest.mark.parametrize("key", ["steps_left_out", "left_out_s", "left_out_h"])
def test_a_fact_of_nothing_is_said_and_not_left_blank(key: str, nothing: object) -> None:
    ((label, text),) = fact_rows({key: nothing})
    assert label in ("steps left out", "left out")
    assert text in ("none", "-")


def test_tables_are_on_page_and_terminal_unless_one_stands_for_the_other(capsys: pytest.CaptureFixture[str]) -> None:
    tables = [Table(header=("A",), rows=[(f"cell {on}",)], on=on) for on in ("all", "page", "terminal")]  # type: ignore[arg-type]
    page, terminal, _ = renderings(replace(WHOLE, sections=(section("Part", *tables),)), capsys)
    assert ["cell all" in page, "cell page" in page, "cell terminal" in page] == [True, True, False]
    assert ["cell all" in terminal, "cell page" in terminal, "cell terminal" in terminal] == [True, False, True]


def test_sections_beside_each_other_are_in_one_pair_and_others_in_none() -> None:
    for flags, pairs in (("", 0), ("01", 1), ("110", 1), ("1101", 2), ("111", 1), ("000", 0)):
        parts = tuple(section(f"Part {place}", "Text.", beside=flag == "1") for place, flag in enumerate(flags))
        page = document_html(replace(WHOLE, sections=parts))
        assert page.count('<div class="pair">') == pairs
        for opened in page.split('<div class="pair">')[1:]:
            inside = opened.split("</div>")[0]
            assert inside.count("<section") == inside.count("</section>") > 0
        kept = re.findall(r"<section id=.part-\d+.>", re.sub(r'<div class="pair">.*?</div>', "", page, flags=re.DOTALL))
        assert len(kept) == flags.count("0")


def test_joined_documents_say_what_each_says_in_order(capsys: pytest.CaptureFixture[str]) -> None:
    more = Document(
        facts={"legs": 3},
        values={"why": "so"},
        findings=("A third.",),
        sections=(section("Part", "Text."),),
        notes=("B",),
    )
    joined = WHOLE + more
    assert (joined.title, joined.mark, joined.command) == (WHOLE.title, WHOLE.mark, WHOLE.command)
    assert joined.summary == {**WHOLE.summary, **more.summary}
    assert joined.findings == (*WHOLE.findings, *more.findings)
    for told in renderings(joined, capsys):
        assert told.index("The second.") < told.index("A third.")
        assert told.index("ignored mood") < told.rindex("B")


def makers() -> list[Callable[..., Document]]:
    """All functions of the room that make a document of a result."""
    found = []
    for path in sorted(EXPORT.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name.endswith("_document"):
                module = ".".join(path.relative_to(EXPORT.parent.parent).with_suffix("").parts)
                found.append(getattr(importlib.import_module(module), node.name))
    return found


def test_kinds_of_results_with_a_document_have_no_page_of_their_own() -> None:
    """Their notes could else be on one and not on the other; what they return says which renderings there are."""
    found = makers()
    assert len(found) >= 10
    templates = {path.stem for path in EXPORT.glob("*/templates/*.html")}
    for maker in found:
        assert maker.__annotations__["return"] == "Document", maker.__name__
        assert maker.__name__.removesuffix("_document") not in templates
        assert not hasattr(importlib.import_module(maker.__module__), maker.__name__.replace("_document", "_html"))
