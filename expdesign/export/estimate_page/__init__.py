"""The document of an estimation: parameters and which of them to use."""

from expdesign.export.estimate_page.page import EstimateContent, estimate_document

__all__ = ["EstimateContent", "estimate_document"]
