"""A watch over a ship in operation as JSON and a document."""

from expdesign.export.monitor_page.content import Moment, MonitorContent, monitor_json
from expdesign.export.monitor_page.page import budget_entries, monitor_document

__all__ = ["Moment", "MonitorContent", "budget_entries", "monitor_document", "monitor_json"]
