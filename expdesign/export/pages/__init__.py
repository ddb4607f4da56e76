"""Templates of self-contained pages: one set-up for all of them."""

from __future__ import annotations

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined, Template

from expdesign.export.formats.format import xml_text


def page_template(package: str, name: str) -> Template:
    """A template of a package, which may use what all pages share: `base.html`, `parts.html` and the style sheet.

    A name that a template uses without a value is an error; text is escaped, and characters that no page may hold are
    replaced.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in (package, "expdesign.export.pages")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    return environment.get_template(name)


def _shown(value: object) -> object:
    return xml_text(value) if type(value) is str else value
