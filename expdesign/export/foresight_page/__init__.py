"""What a diagnosis would find, before the trial is sailed: page, JSON and table."""

from expdesign.export.foresight_page.content import HEADER, ForesightContent, foresight_json, foresight_rows, size_text
from expdesign.export.foresight_page.page import foresight_html

__all__ = ["HEADER", "ForesightContent", "foresight_html", "foresight_json", "foresight_rows", "size_text"]
