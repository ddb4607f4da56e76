"""Manoeuvring indices as a form: criteria of the resolution and results, as JSON, table and page."""

from expdesign.export.indices_form.form import Held, IndicesContent, indices_json, verdict_rows, zigzag_rows
from expdesign.export.indices_form.page import indices_html
