"""Runs a benchmark and records what it prints in the README beside it.

``python tests/benchmarks/record.py planner [ARGUMENT ...]``: the section `planner` is replaced by the benchmark's
description, the command, the machine, and the output. Tables whose rows begin with a version keep those of earlier
releases, and of cases that were not measured again. A path outside the project is recorded as FOLDER. Nothing is
recorded of a benchmark that fails.
"""

from __future__ import annotations

import ast
import itertools
import os
import platform
import re
import subprocess
import sys
from datetime import date
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
README = HERE / "README.md"
VERSION_ROW = re.compile(r"^\| (\d[\w.]*) \([^|]*\) \| ([^|]*) \|.*\n", flags=re.MULTILINE)
"""`| 0.1.0 (2026-01-31) | case | ...`: a row of a table that is kept by release."""


def measured(script: Path, arguments: list[str]) -> str:
    """What the benchmark prints; shown while it runs."""
    lines = []
    with subprocess.Popen([sys.executable, script, *arguments], stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            lines.append(line)
    if process.returncode:
        raise SystemExit(f"{script.name} ended with status {process.returncode}; nothing is recorded")
    return "".join(lines)


def section(name: str, script: Path, arguments: list[str], output: str) -> str:
    """Heading, description, command, machine and output in Markdown."""
    summary = (ast.get_docstring(ast.parse(script.read_text("utf-8"))) or "").split("\n\n")[0].replace("\n", " ")
    shown = [_without_places(item) for item in arguments]
    command = " ".join(["python", f"tests/benchmarks/{name}.py", *shown])
    machine = f"{os.cpu_count()} cores, Python {platform.python_version()}, NumPy {version('numpy')}"
    return f"## {name}\n\n{summary}\n\n`{command}` on {date.today()}, {machine}:\n\n{in_markdown(output)}\n"


def _without_places(argument: str) -> str:
    """An argument as anyone can give it: paths of the project from its root, others as FOLDER."""
    path = Path(argument).resolve()
    if not path.exists():
        return argument
    return path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else "FOLDER"


def in_markdown(output: str) -> str:
    """Tables as they are, other text as preformatted blocks."""
    blocks = itertools.groupby(output.rstrip().splitlines(), key=lambda line: line.startswith("|"))
    texts = ((table, "\n".join(lines).strip("\n")) for table, lines in blocks)
    return "\n\n".join(text if table else f"```text\n{text}\n```" for table, text in texts if text)


def recorded(readme: str, name: str, text: str) -> str:
    """The README with one section replaced, or added in alphabetical order."""
    head, *sections = re.split(r"^(?=## )", readme, flags=re.MULTILINE)
    kept = {part.split("\n", 1)[0]: part.rstrip() + "\n" for part in sections}
    kept[f"## {name}"] = with_earlier_rows(text, kept.get(f"## {name}", ""))
    return "\n".join([head.rstrip() + "\n", *(kept[title] for title in sorted(kept))])


def with_earlier_rows(new: str, old: str) -> str:
    """A section whose table of versions keeps the old rows of other versions and cases, before its own."""
    measured_now = {row.group(1, 2) for row in VERSION_ROW.finditer(new)}
    kept = [row.group() for row in VERSION_ROW.finditer(old) if row.group(1, 2) not in measured_now]
    first = VERSION_ROW.search(new)
    return new if first is None else new[: first.start()] + "".join(kept) + new[first.start() :]


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    chosen, options = sys.argv[1].removesuffix(".py"), sys.argv[2:]
    source = HERE / f"{chosen}.py"
    new = section(chosen, source, options, measured(source, options))
    README.write_text(recorded(README.read_text("utf-8"), chosen, new), "utf-8")
