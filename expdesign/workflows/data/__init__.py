"""Commands on measured data; one file each."""
