"""Results of a watch over a ship in operation: JSON, sentences and a page."""

from expdesign.export.monitor_page.content import (
    Moment,
    MonitorContent,
    monitor_header,
    monitor_json,
    monitor_tables,
    sentences,
)
from expdesign.export.monitor_page.page import budget_entries, monitor_html
