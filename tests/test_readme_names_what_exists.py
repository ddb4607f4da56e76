"""READMEs and manual are short, and name files and commands that exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from expdesign.cli import main

ROOT = Path(__file__).parents[1]
READMES = (ROOT / "README.md", ROOT / "scenarios" / "README.md", ROOT / "tests" / "benchmarks" / "README.md")
MANUAL = tuple(sorted((ROOT / "expdesign" / "manual").glob("*.md")))


@pytest.mark.parametrize("readme", READMES, ids=lambda path: path.parent.name)
def test_every_path_that_a_readme_names_exists(readme: Path) -> None:
    paths = set(re.findall(r"(?<![\w/.])(?:\.github|scenarios|tests|expdesign)/[\w./*-]*\w", readme.read_text()))
    assert paths
    missing = [path for path in paths if "NAME" not in path and not list(ROOT.glob(path))]
    assert not missing


def test_the_readme_fits_on_a_few_screens() -> None:
    assert len((ROOT / "README.md").read_bytes()) <= 9000


def commands() -> list[str]:
    """Command lines of all READMEs and of the manual, continued lines joined."""
    text = "\n".join(readme.read_text() for readme in (*READMES, *MANUAL)).replace("\\\n", " ")
    return sorted(set(re.findall(r"(?<!from )\bexpdesign ([a-z][\w-]+ [^`&#\n]*)", text)))


@pytest.mark.parametrize("command", commands())
def test_every_command_of_a_readme_is_one_that_the_program_has(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its options are looked up in the help of the command, which runs nothing."""
    name, *arguments = shlex.split(command)
    assert main([name, "--help"]) == 0
    text = capsys.readouterr().out
    options = [argument for argument in arguments if argument.startswith("--")]
    assert [option for option in options if option not in text] == []
