"""Commands that run, test or continue a planned trial; one file each."""
