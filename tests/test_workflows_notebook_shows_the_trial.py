"""In a notebook a trial shows its report, and the README's example runs."""

import html
import re
from pathlib import Path

import pytest

import export_case as case
from expdesign.export.routes import build_route
from expdesign.workflows import notebook
from expdesign.workflows.notebook import Trial

README = Path(__file__).parents[1] / "README.md"


PAGE = '<!DOCTYPE html>\n<p title="a">b &amp; &quot;c&quot;</p></iframe>'


def made(*_: object, **__: object) -> Trial:
    route = build_route(case.planned(), safe_water=case.plan().area.water)
    return Trial(content=case.report_content(route=route), route=route)


def test_a_trial_shows_the_report_in_a_frame_that_nothing_breaks_out_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notebook, "report_html", lambda content: PAGE + content.scenario)
    shown = made()._repr_html_()
    inside = re.fullmatch(r'<iframe srcdoc="([^"]*)" style="[^"]*" title="report"></iframe>', shown)
    assert inside is not None
    assert html.unescape(inside[1]) == PAGE + "test-sound"


@pytest.fixture
def _unread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages that nobody looks at in a test are not drawn."""
    monkeypatch.setattr(notebook, "report_html", lambda content: content.scenario)
    monkeypatch.setattr(notebook, "cards_html", lambda content: content.scenario)


@pytest.mark.usefixtures("_unread")
def test_a_trial_writes_the_report_the_cards_and_every_route(tmp_path: Path) -> None:
    written = {path.name for path in made().write(tmp_path / "trial")}
    assert written == {
        "report.html", "cards.html", "route.rtz", "route.gpx", "route.kml", "route.geojson", "route.plan",
        "route.waypoints", "route.csv",
    }  # fmt: skip


@pytest.mark.usefixtures("_unread")
def test_the_notebook_example_of_the_readme_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Line by line; only the search for a plan, which takes minutes, is replaced by one made before."""
    code = next(
        block for block in re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL) if "plan_for" in block
    )
    monkeypatch.setattr(notebook, "plan_for", made)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").symlink_to(README.parent / "scenarios")
    names: dict[str, object] = {}
    exec(code, names)  # noqa: S102  the example of our own README
    assert isinstance(names["trial"], Trial)
    assert (tmp_path / "runs" / "helsinki" / "cards.html").exists()
