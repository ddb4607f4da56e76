"""Studies: many simulated cases at once, and published reference numbers beside our own."""
