"""The pages, a module for each; each has `register`, which gives it its address."""
