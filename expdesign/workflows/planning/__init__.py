"""Commands that design and plan a trial, and compare or export what they give; one file each."""
