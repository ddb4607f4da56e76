"""`expdesign explain`: keys of files and names on the command line, from the modules that read them."""
