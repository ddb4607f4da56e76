"""Example scenarios made shorter, and the files of their trials, made once in a run of the tests."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

from counted_work import counted_work
from expdesign import workflows
from expdesign.memory import VARIABLE
from scenario_files import SCENARIOS, spoil

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
    """Folder and file names of `expdesign run` on an example, seed 1; what it remembers lies beside it in `-cache`."""

    def run(folder: Path) -> list[str]:
        scenario = copied(folder.with_name(f"{folder.name}-scenario"), name, {} if whole else SHORTER[name])
        told: list[tuple[str, float]] = []
        memory = {VARIABLE: str(folder.with_name(f"{folder.name}-cache"))}
        with counted_work() as (counts, progress), patch.dict(os.environ, memory):

            def report(activity: str, share: float) -> None:
                told.append((activity, share))
                progress(activity, share)

            files = [path.name for path in workflows.run(scenario, folder, seed=1, progress=report).files]
        folder.with_name(f"{folder.name}-work.json").write_text(json.dumps(counts), encoding="utf-8")
        folder.with_name(f"{folder.name}-told.json").write_text(json.dumps(told), encoding="utf-8")
        return files

    return made_once(f"{name}-whole" if whole else name, run)


def example_work(made_once: Callable, name: str) -> dict[str, dict[str, int]]:
    """How much was done by phase and by kind of work while the short example was planned."""
    folder, _ = example_run(made_once, name)
    return json.loads(folder.with_name(f"{folder.name}-work.json").read_text(encoding="utf-8"))


def example_told(made_once: Callable, name: str) -> list[tuple[str, float]]:
    """Activities and shares of the work that were told while the short example was planned."""
    folder, _ = example_run(made_once, name)
    return [tuple(item) for item in json.loads(folder.with_name(f"{folder.name}-told.json").read_text("utf-8"))]
