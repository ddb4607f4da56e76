"""The page: the same commands on the same files, with a chart to draw on, forms, progress and results.

`server` says who may ask and what is served, `folder` keeps files and their versions, `jobs` runs commands, `answers`
asks the workflows for what must be there at once, `forms` makes forms of the tables that read the files, and `pages`
has a module for each page. Needs the extra `web`.
"""
