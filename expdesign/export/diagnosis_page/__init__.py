"""The page about a diagnosis: one self-contained file."""

from expdesign.export.diagnosis_page.page import diagnosis_html
from expdesign.export.diagnosis_page.results import diagnosis_json, diagnosis_tables, extended_vessel

__all__ = ["diagnosis_html", "diagnosis_json", "diagnosis_tables", "extended_vessel"]
