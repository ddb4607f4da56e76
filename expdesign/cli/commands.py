"""All commands: importing the modules registers them, in the order in which `--help` lists them."""

from expdesign.cli import planning, recorded, trials
from expdesign.cli.app import app

__all__ = ["app", "planning", "recorded", "trials"]
