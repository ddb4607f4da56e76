"""The report: one self-contained page about a trial."""

from expdesign.export.report.content import ReportContent
from expdesign.export.report.page import report_html
