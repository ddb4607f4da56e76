"""Commands on the data of step trials; one file each."""
