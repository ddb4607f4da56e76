"""Commands that design and plan a trial, and compare or export the results; one file each."""
