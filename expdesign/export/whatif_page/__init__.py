"""Variants of a trial side by side: JSON and a document."""

from expdesign.export.whatif_page.content import Case, WhatIfContent, explanations, whatif_json
from expdesign.export.whatif_page.page import whatif_document
