"""The floors of the architecture hold: imports go down or stay in their own room, foreign solvers have one importer."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import expdesign

ROOT = Path(expdesign.__file__).parent

FLOORS = (
    ("errors", "interruptions"),
    ("conventions", "values"),
    ("signals",),
    ("vessel",),
    ("simulation", "records"),
    ("dictionary", "estimation", "indices"),
    ("information", "diagnosis", "assessment"),
    ("durations",),
    ("plan",),
    ("scenario", "export"),
    ("studies", "workflows"),
    ("cli", "__main__"),
)
FLOOR_OF = {"__init__": 0} | {room: floor for floor, rooms in enumerate(FLOORS, start=1) for room in rooms}
EXCEPTIONS = {("__main__", "cli")}  # `python -m` is nothing but the command line under another name

IMPORTERS = {
    "cvxpy": (),
    "ompl": ("plan/_ompl.py",),
    "casadi": ("durations/_casadi.py", "estimation/_casadi.py", "plan/_casadi.py"),
    "matplotlib": ("export/",),
}
BANNED_CALLS = ("eval", "exec", "compile", "__import__", "import_module")


def violations(root: Path) -> list[str]:
    """Every broken rule in a package, as `file:line: what`."""
    return [
        f"{path.relative_to(root).as_posix()}:{line}: {what}"
        for path in sorted(root.rglob("*.py"))
        for line, what in broken_rules(path, root)
    ]


def broken_rules(path: Path, root: Path) -> Iterator[tuple[int, str]]:
    """(line, what) of every broken rule in one file."""
    room = room_of(path, root)
    if room not in FLOOR_OF:
        yield 1, f"{room} has no floor"
        return
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for module in imported_modules(node, path, root):
            if what := broken_import(module, room, path.relative_to(root).as_posix(), root.name):
                yield node.lineno, what
        if isinstance(node, ast.Call) and (name := called_name(node.func)) in BANNED_CALLS:
            yield node.lineno, f"calls {name}"


def room_of(path: Path, root: Path) -> str:
    """The folder or module directly under the package that a file belongs to."""
    return path.relative_to(root).parts[0].removesuffix(".py")


def imported_modules(node: ast.AST, path: Path, root: Path) -> list[str]:
    """Dotted names of all that an import statement may load; relative ones are spelled out."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    package = [root.name, *path.relative_to(root).parent.parts]
    base = package[: len(package) - node.level + 1] if node.level else []
    module = ".".join([*base, *([node.module] if node.module else [])])
    return [f"{module}.{alias.name}" for alias in node.names]


def broken_import(module: str, room: str, file: str, package: str) -> str | None:
    """What is wrong with importing `module` in `file` of `room`, or None."""
    top, _, rest = module.partition(".")
    if top == package:
        target = rest.partition(".")[0]
        down = FLOOR_OF.get(target, 0) < FLOOR_OF[room] or (room, target) in EXCEPTIONS
        return None if down or target == room else f"{room} imports {target}, which is not below it"
    allowed = IMPORTERS.get(top, (file,))
    return None if file.startswith(allowed) else f"imports {top}, which only {' '.join(allowed)} may"


def called_name(function: ast.expr) -> str | None:
    """`eval` for `eval(...)` and `builtins.eval(...)`; methods of other things do not count."""
    if isinstance(function, ast.Name):
        return function.id
    if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
        return function.attr if function.value.id in ("builtins", "importlib") else None
    return None


def test_every_import_goes_down_or_stays_in_its_room() -> None:
    assert violations(ROOT) == []


def test_the_scan_sees_the_whole_package() -> None:
    seen = {room_of(path, ROOT) for path in ROOT.rglob("*.py")}
    assert {"errors", "vessel", "plan", "cli", "__main__"} <= seen
    assert any(
        "expdesign.errors" in module
        for node in ast.walk(ast.parse((ROOT / "values.py").read_text(encoding="utf-8")))
        for module in imported_modules(node, ROOT / "values.py", ROOT)
    )


@pytest.mark.parametrize(
    ("file", "source", "what"),
    [
        ("values.py", "import expdesign.vessel", "values imports vessel"),
        ("values.py", "from expdesign import vessel", "values imports vessel"),
        ("values.py", "from .vessel import Vessel", "values imports vessel"),
        ("values.py", "def f():\n    from expdesign.plan.area import SeaArea", "values imports plan"),
        ("vessel/deep/model.py", "from ...simulation import run", "vessel imports simulation"),
        ("scenario/read.py", "from expdesign.export import rtz", "scenario imports export"),
        ("conventions.py", "from expdesign.values import Array", "conventions imports values"),
        ("plan/area.py", "import cvxpy as cp", "imports cvxpy"),
        ("durations/solve.py", "from casadi import MX", "imports casadi"),
        ("studies/figures.py", "import matplotlib.pyplot as plt", "imports matplotlib"),
        ("vessel/terms.py", "eval('1')", "calls eval"),
        ("vessel/terms.py", "import builtins\nbuiltins.exec('1')", "calls exec"),
        ("vessel/terms.py", "import importlib\nimportlib.import_module('expdesign.cli')", "calls import_module"),
        ("helpers.py", "", "helpers has no floor"),
        ("attic/old.py", "", "attic has no floor"),
    ],
)
def test_a_broken_rule_is_caught(tmp_path: Path, file: str, source: str, what: str) -> None:
    assert what in "".join(violations(package_with(tmp_path, file, source)))


@pytest.mark.parametrize(
    ("file", "source"),
    [
        ("values.py", "from expdesign.errors import ShapeError"),
        ("plan/order.py", "from expdesign.plan.area import SeaArea\nfrom . import values\nfrom .. import __version__"),
        ("plan/_ompl.py", "from ompl import base"),
        ("export/figures/chart.py", "import matplotlib"),
        ("vessel/terms.py", "import re\nre.compile('a')"),
    ],
)
def test_what_is_allowed_passes(tmp_path: Path, file: str, source: str) -> None:
    assert violations(package_with(tmp_path, file, source)) == []


def package_with(folder: Path, file: str, source: str) -> Path:
    """A package `expdesign` that holds one file."""
    path = folder / "expdesign" / file
    path.parent.mkdir(parents=True)
    path.write_text(source, encoding="utf-8")
    return folder / "expdesign"
