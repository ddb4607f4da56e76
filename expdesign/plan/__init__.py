"""The plan: sea area, placement and order of runs, legs between them, verification."""
