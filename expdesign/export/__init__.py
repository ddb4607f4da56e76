"""Results leave the package here: JSON and CSV, route files, documents, pages and figures."""
