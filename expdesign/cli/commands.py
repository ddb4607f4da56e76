"""All commands: importing the modules registers them, in the order in which `--help` lists them."""

from expdesign.cli import planning, recorded  # isort: split

from expdesign.cli import operation, trials  # isort: split

from expdesign.cli import explaining, pages  # isort: split

from expdesign.cli.app import app

__all__ = ["app", "explaining", "operation", "pages", "planning", "recorded", "trials"]
