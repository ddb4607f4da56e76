"""Templates of self-contained pages: one set-up for all of them."""

from __future__ import annotations

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined, Template

from expdesign.export.formats.format import xml_text


def page_template(name: str, *, package: str = __name__) -> Template:
    """A template in the folder `templates` of a package.

    It may use what all pages share: `base.html`, `parts.html` and the style sheet. A name that a template uses without
    a value is an error; text is escaped, and characters that no page may hold are replaced.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(one) for one in (package, __name__)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    return environment.get_template(name)


def _shown(value: object) -> object:
    return xml_text(value) if type(value) is str else value
