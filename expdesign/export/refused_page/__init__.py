"""The draft of a refused plan: what stands in the way, where, what helps; never a route."""

from expdesign.export.refused_page.page import Refusal, refused_html, refused_json

__all__ = ["Refusal", "refused_html", "refused_json"]
