"""Results of the validation of designs in simulated trials: JSON and a page."""

from expdesign.export.validation_page.content import ValidationContent, judgements, validation_json
from expdesign.export.validation_page.page import validation_html

__all__ = ["ValidationContent", "judgements", "validation_html", "validation_json"]
