"""`expdesign explain`: what may stand in files and on the command line, from the places that read it."""
