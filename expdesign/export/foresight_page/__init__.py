"""What a diagnosis would find, before the trial is sailed: page, JSON and table."""

from expdesign.export.foresight_page.content import (
    HEADER,
    ForesightContent,
    conclusions,
    foresight_json,
    foresight_rows,
    size_text,
)
from expdesign.export.foresight_page.operation import (
    OPERATION_HEADER,
    OperationContent,
    operation_html,
    operation_json,
    operation_rows,
    operation_sentences,
)
from expdesign.export.foresight_page.page import foresight_html

__all__ = [
    "HEADER",
    "OPERATION_HEADER",
    "ForesightContent",
    "OperationContent",
    "conclusions",
    "foresight_html",
    "foresight_json",
    "foresight_rows",
    "operation_html",
    "operation_json",
    "operation_rows",
    "operation_sentences",
    "size_text",
]
