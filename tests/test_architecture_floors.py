"""The floors of the architecture hold: imports go down or stay in their own room, foreign solvers have one importer."""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import expdesign

ROOT = Path(expdesign.__file__).parent

FLOORS = {
    "": (
        ("errors", "interruptions", "lazy", "progress", "threads"),
        ("input_files", "processes", "requests"),
        ("memory",),
        ("conventions", "saved", "values"),
        ("own_units", "signals", "sea_area", "waves"),
        ("vessel",),
        ("simulation", "records"),
        ("reduction",),
        ("dictionary", "estimation", "indices", "step_trials"),
        ("information", "diagnosis", "assessment", "roll", "kinematics", "particulars"),
        ("durations",),
        ("growing", "rehearsal", "plan", "monitoring", "loading", "importing"),
        ("shortest_day", "foresight"),
        ("scenario", "export"),
        ("workflows",),
        ("web",),
        ("cli", "__main__"),
    ),
    "records": (("file",), ("limits", "pose"), ("load", "pieces")),
    "step_trials": (
        ("holds", "responses"),
        ("steady_state", "noise"),
        ("samples",),
        ("surfaces",),
        ("identify", "nominal", "live"),
    ),
    "estimation": (
        ("regression",),
        ("noise", "replay"),
        ("solve",),
        ("output_error", "feedback"),
        ("values",),
        ("disturbance", "excitation"),
        ("instrumental",),
        ("methods",),
    ),
    "diagnosis": (
        ("data",),
        ("model",),
        ("motion", "causes", "vessel_file"),
        ("accuracy", "discriminating_manoeuvre"),
        ("fit",),
        ("select",),
        ("remainder", "prediction_comparison"),
        ("stated_parameters",),
        ("judgement",),
        ("values",),
        ("conclusions",),
        ("diagnose",),
    ),
    "plan": (
        ("values",),
        ("resimulation",),
        ("verify", "chart", "control", "runs"),
        ("legs",),
        ("local_planner",),
        ("bounds",),
        ("search", "monte_carlo"),
        ("feasibility",),
        ("assembly", "checked", "legs_ahead"),
        ("sailing",),
        ("drafts",),
        ("remedy_changes",),
        ("remedies",),
        ("solve",),
    ),
    "web": (("folder", "jobs", "answers"), ("forms", "site"), ("pages",), ("server",)),
    "workflows": (
        ("outcome",),
        ("steps",),
        ("commands",),
        ("notebook", "asked"),
    ),
}
"""For the package and every room of rooms: what stands on what; neighbours on a floor do not know each other."""
FLOOR_OF = {
    room: {"__init__": 0} | {name: floor for floor, names in enumerate(floors, start=1) for name in names}
    for room, floors in FLOORS.items()
}
NO_FACADES = ("workflows",)
"""Rooms of rooms whose modules are imported one by one, so that a command loads only what it needs."""
EXCEPTIONS = {("__main__", "cli")}  # `python -m` is nothing but the command line under another name

IMPORTERS = {
    "cvxpy": ("durations/_cvxpy.py",),
    "ompl": ("plan/legs/_ompl.py",),
    "distributed": ("processes/_dask.py",),
    "casadi": (
        "simulation/_casadi.py",
        "estimation/replay/_casadi.py",
        "growing/_casadi.py",
        "plan/legs/_casadi.py",
        "vessel/_casadi.py",
    ),
    "matplotlib": ("export/",),
}
BANNED_CALLS = ("eval", "exec", "compile", "__import__", "import_module")
LOADER = ("lazy.py", "import_module")
"""The one place that imports by name; façades that use it import the same names for the type checker."""


def violations(root: Path) -> list[str]:
    """Every broken rule in a package, as `file:line: what`."""
    return [
        f"{path.relative_to(root).as_posix()}:{line}: {what}"
        for path in sorted(root.rglob("*.py"))
        for line, what in broken_rules(path, root)
    ]


def broken_rules(path: Path, root: Path) -> Iterator[tuple[int, str]]:
    """(line, what) of every broken rule in one file."""
    here = path.relative_to(root).with_suffix("").parts
    for room, name in rooms_of(here):
        if name not in FLOOR_OF[room] and name != "__init__":
            yield 1, f"{'/'.join(filter(None, (room, name)))} has no floor"
            return
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for module in imported_modules(node, path, root):
            if what := broken_import(module, here, root):
                yield node.lineno, what
        name = called_name(node.func) if isinstance(node, ast.Call) else None
        if name in BANNED_CALLS and (f"{'/'.join(here)}.py", name) != LOADER:
            yield node.lineno, f"calls {name}"


def rooms_of(parts: tuple[str, ...]) -> list[tuple[str, str]]:
    """(room, name in it) for every room with floors that a dotted path leads through."""
    rooms = [("/".join(parts[:depth]), parts[depth]) for depth in range(len(parts))]
    return [(room, name) for room, name in rooms if room in FLOORS]


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


def broken_import(module: str, here: tuple[str, ...], root: Path) -> str | None:
    """What is wrong with importing `module` in the file at `here`, or None."""
    top, _, rest = module.partition(".")
    if top != root.name:
        file = f"{'/'.join(here)}.py"
        allowed = IMPORTERS.get(top, (file,))
        return None if file.startswith(allowed) else f"imports {top}, which only {' '.join(allowed)} may"
    there = tuple(rest.split("."))
    for (room, name), (other, target) in zip(rooms_of(here), rooms_of(there), strict=False):
        if room != other or name == target or "__init__" in (name, target) or (name, target) in EXCEPTIONS:
            continue
        if FLOOR_OF[room].get(target, 0) >= FLOOR_OF[room][name]:
            return f"{name} imports {target}, which is not below it"
    return behind_facade(there, here, root)


def behind_facade(there: tuple[str, ...], here: tuple[str, ...], root: Path) -> str | None:
    """What is wrong where an import reaches past the `__init__` of a room inside a room of rooms, or None."""
    if there[0] not in FLOORS or there[0] in NO_FACADES or len(there) < 4 or here[:2] == there[:2]:
        return None
    if not root.joinpath(*there[:2]).is_dir():
        return None
    return f"imports {'.'.join(there[:3])}, which is inside the room {'.'.join(there[:2])}"


def lazy_facades() -> list[str]:
    """Packages whose names load on use."""
    files = [path for path in ROOT.rglob("__init__.py") if "load_on_use(" in path.read_text(encoding="utf-8")]
    return [".".join((ROOT.name, *path.parent.relative_to(ROOT).parts)) for path in files]


def called_name(function: ast.expr) -> str | None:
    """`eval` for `eval(...)` and `builtins.eval(...)`; methods of other things do not count."""
    if isinstance(function, ast.Name):
        return function.id
    if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
        return function.attr if function.value.id in ("builtins", "importlib") else None
    return None


def test_every_import_goes_down_or_stays_in_its_room() -> None:
    assert violations(ROOT) == []


def test_verification_imports_nothing_of_the_planner_but_its_values() -> None:
    verification = [ROOT / "plan" / name for name in ("verify.py", "resimulation.py")]
    imports = {
        module.split(".")[2]
        for path in verification
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        for module in imported_modules(node, path, ROOT)
        if module.startswith("expdesign.plan.")
    }
    assert imports == {"values", "resimulation"}


@pytest.mark.thorough
def test_no_test_imports_from_another_test_file() -> None:
    tests = sorted(Path(__file__).parent.glob("*.py"))
    imports = {(path.name, name) for path in tests for name in imported_names(path) if name.startswith("test_")}
    assert imports == set()
    assert "expdesign" in imported_names(Path(__file__))


def imported_names(path: Path) -> set[str]:
    """First parts of the names of all modules that a file imports, inside functions too."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    named = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    named += [node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)]
    return {name.split(".")[0] for name in named}


@pytest.mark.parametrize("name", lazy_facades())
def test_every_name_of_a_facade_that_loads_on_use_is_there(name: str) -> None:
    package = importlib.import_module(name)
    modules = {path.stem for path in Path(str(package.__file__)).parent.iterdir()}
    assert not modules & set(package.__all__)  # once a module is imported, it hides a name that it shares
    assert all(getattr(package, public) is not None for public in package.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        package.nonsense  # noqa: B018


def test_the_scan_sees_the_whole_package() -> None:
    seen = {path.relative_to(ROOT).parts[0].removesuffix(".py") for path in ROOT.rglob("*.py")}
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
        ("values.py", "def f():\n    from expdesign.plan.values import Plan", "values imports plan"),
        ("vessel/deep/model.py", "from ...simulation import run", "vessel imports simulation"),
        ("scenario/read.py", "from expdesign.export import rtz", "scenario imports export"),
        ("conventions.py", "from expdesign.values import Array", "conventions imports values"),
        ("plan/solve.py", "import cvxpy as cp", "imports cvxpy"),
        ("durations/solve.py", "from casadi import MX", "imports casadi"),
        ("workflows/commands/figures.py", "import matplotlib.pyplot as plt", "imports matplotlib"),
        ("vessel/terms.py", "eval('1')", "calls eval"),
        ("vessel/terms.py", "import builtins\nbuiltins.exec('1')", "calls exec"),
        ("vessel/terms.py", "import importlib\nimportlib.import_module('expdesign.cli')", "calls import_module"),
        ("plan/verify.py", "from expdesign.plan.chart import VisibilityGraph", "verify imports chart"),
        ("plan/legs/agile.py", "from expdesign.plan.search import place_runs", "legs imports search"),
        ("plan/attic/old.py", "", "plan/attic has no floor"),
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
        ("plan/solve.py", "from expdesign.sea_area import SeaArea\nfrom . import values\nfrom .. import __version__"),
        ("plan/legs/_ompl.py", "from ompl import base"),
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
