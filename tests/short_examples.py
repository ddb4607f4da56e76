"""Example scenarios made shorter, and the files of their trials, made once in a run of the tests."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from expdesign import workflows
from scenario_files import spoil

SCENARIOS = Path(__file__).parents[1] / "scenarios"
SHORTER = {
    "story": {"total_s = 720.0": "total_s = 400.0"},
    "model-ship": {"total_s = 450.0": "total_s = 112.5"},
    "harbour": {},
}
"""Entries of the scenarios that are changed; the harbour is short as it is."""


def copied(folder: Path, name: str, changes: dict[str, str]) -> Path:
    """An example scenario with some entries changed, in a copy of the examples."""
    shutil.copytree(SCENARIOS, folder / "scenarios", dirs_exist_ok=True)
    for old, new in changes.items():
        spoil(folder / "scenarios" / f"{name}.toml", old, new)
    return folder / "scenarios" / f"{name}.toml"


def example_run(made_once: Callable, name: str, *, whole: bool = False) -> tuple[Path, list[str]]:
    """Folder and file names of `expdesign run` on an example, seed 1."""

    def run(folder: Path) -> list[str]:
        scenario = copied(folder.with_name(f"{folder.name}-scenario"), name, {} if whole else SHORTER[name])
        return [path.name for path in workflows.run(scenario, folder, seed=1).files]

    return made_once(f"{name}-whole" if whole else name, run)
