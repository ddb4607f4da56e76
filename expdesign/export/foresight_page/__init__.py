"""What a diagnosis would find, before the trial is sailed: page, JSON and table."""

from expdesign.export.foresight_page.content import ForesightContent, foresight_json, foresight_rows

__all__ = ["ForesightContent", "foresight_json", "foresight_rows"]
