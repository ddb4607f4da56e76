"""Pages of results in a real browser: nothing is cut on a tablet or a laptop, and each run card is one printed page."""

import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from expdesign.cli import main
from scenario_files import SCENARIOS

pytestmark = pytest.mark.browser

SHIP = f"{SCENARIOS}/vessels/logged-50m.toml"
COMMANDS = {
    "import.html": ("import", f"{SCENARIOS}/logs/bridge.csv", "--vessel", SHIP),
    "indices.html": ("indices", "out/import", "--vessel", SHIP),
    "estimate.html": ("estimate", "out/import", "--vessel", SHIP, "--method", "ls"),
    "diagnosis.html": ("diagnose", "out/import", "--vessel", SHIP),
    "nominal.html": ("nominal", f"{SCENARIOS}/cards/coaster-80m.toml"),
    "report.html": ("run", "craft/scenario.toml"),
    "whatif.html": ("whatif", "craft/scenario.toml", "craft/longer.toml"),
}
"""Page -> the command that writes it, in the order in which they need each other."""
CUT = """[...document.querySelectorAll('body *')].filter(e => e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1 &&
    getComputedStyle(e).overflowX != 'visible').map(e => e.innerText.slice(0, 60))"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the results of all commands."""
    root, before = tmp_path_factory.mktemp("results"), Path.cwd()
    os.chdir(root)
    try:
        assert main(["new", "craft", "--kind", "asv", "--quiet"]) == 0
        Path("craft/longer.toml").write_text("[design]\ntotal_s = 240.0\n", encoding="utf-8")
        for words in COMMANDS.values():
            assert main([*words, "--out", f"out/{words[0]}", "--quiet"]) == 0, words
        yield root / "out"
    finally:
        os.chdir(before)


@pytest.mark.parametrize("width", [768, 1366])
def test_nothing_is_cut_or_wider_than_the_window(browser, results: Path, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    pages = sorted(results.rglob("*.html"))
    assert {path.name for path in pages} >= set(COMMANDS)
    for path in pages:
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= width, path
        assert not page.evaluate(CUT), path
    page.close()


def test_each_run_card_is_one_printed_page(browser, results: Path) -> None:
    page = browser.new_page()
    page.goto((results / "run/cards.html").as_uri())
    page.evaluate("document.querySelectorAll('section.sheet:not(.card)').forEach(e => e.remove())")  # may share a page
    cards = page.locator("section.card").count()
    assert cards >= 2
    printed = page.pdf(format="A4", print_background=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == cards
    page.close()
