"""The page about an estimation: one self-contained file."""

from expdesign.export.estimate_page.page import EstimateContent, estimate_html, estimate_notes
