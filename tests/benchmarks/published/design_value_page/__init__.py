"""What designs were worth in a study of simulated trials, as in figures of its source: a page."""

from design_value_page.page import DesignErrors, StudyTable, design_value_html

__all__ = ["DesignErrors", "StudyTable", "design_value_html"]
