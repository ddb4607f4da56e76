"""Self-contained pages: one set-up for their templates, and a document as a page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined, Template

from expdesign import __version__
from expdesign.export.document import Block, Document, Figure, Gallery, Table, fact_rows
from expdesign.export.formats.format import xml_text
from expdesign.progress import Progress, in_phases, silent

MANY_SECTIONS = 7  # from which a page has links to them
DRAWING = "drawing the page"
DRAWING_LOADS = 3.0  # how many figures could be drawn while the library for them loads, for the progress told


def page_template(name: str, *, package: str = __name__) -> Template:
    """A template in the folder `templates` of a package.

    It may use what all pages share: `base.html`, `parts.html` and the style sheet. A name that a template uses without
    a value is an error; text is escaped, and characters that no page may hold are replaced.
    """
    return _environment(package).get_template(name)


@cache
def _environment(package: str) -> Environment:
    """Of all templates of a package, each compiled once in a process: that takes longer than filling one in."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(one) for one in (package, __name__)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    environment.globals["version"] = __version__
    environment.filters.update(kind=lambda block: type(block).__name__, number=id)
    return environment


def _shown(value: object) -> object:
    return type(value)(xml_text(value)) if isinstance(value, str) else value


def document_html(document: Document, *, progress: Progress = silent) -> str:
    """One HTML page without any outside reference."""
    return page_template("document.html").render(shown(document, partial(_drawn, progress)))


def shown(
    document: Document, draw: Callable[[Sequence[Figure]], Mapping[int, object]], *more: Figure
) -> dict[str, object]:
    """What the template of a document reads, its figures and some more drawn."""
    sections = [part for part in document.sections if not part.blocks or any(map(_on_page, part.blocks))]
    contents = [(number, section.title) for number, section in enumerate(sections, start=1) if section.level == 2]
    figures = [figure for part in sections for block in part.blocks for figure in _figures(block)]
    return {
        "document": document,
        "sections": sections,
        "facts": list(fact_rows(document.facts)),
        "contents": contents if len(contents) >= MANY_SECTIONS else (),
        "drawn": draw([*more, *figures]),
    }


def _on_page(block: Block) -> bool:
    return not isinstance(block, Table) or block.on != "terminal"


def _figures(block: Block) -> tuple[Figure, ...]:
    return block.figures if isinstance(block, Gallery) else (block,) if isinstance(block, Figure) else ()


def _drawn(progress: Progress, figures: Sequence[Figure]) -> dict[int, object]:
    """Every figure, by its identity."""
    if not figures:
        return {}
    from expdesign.export.pages.figures import report_style  # a page without figures does not wait for it

    loading, drawing = in_phases(progress, DRAWING_LOADS, len(figures))
    with report_style():
        loading(DRAWING, 1.0)
        drawn: dict[int, object] = {}
        for number, figure in enumerate(figures, start=1):
            drawn[id(figure)] = figure.draw()
            drawing(DRAWING, number / len(figures))
    return drawn
