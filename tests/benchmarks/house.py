"""How large is the house: files and lines by kind, values, depth, integrators, fit engines, own lines of each command.

    python tests/benchmarks/house.py

Read from the sources; nothing is run. Integrators are functions with the weights of Runge and Kutta. Fit engines are
modules that call an optimiser of SciPy's, and those in which a line of a docstring begins with the method of Gauss and
Newton or of Levenberg and Marquardt. Own lines of a command are those of modules that no other command comes to by
imports.
"""

from __future__ import annotations

import ast
from collections import Counter
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "expdesign"
FILES = {
    ".".join(["expdesign", *path.relative_to(PACKAGE).with_suffix("").parts]).removesuffix(".__init__"): path
    for path in sorted(PACKAGE.rglob("*.py"))
}
OPTIMISERS = ("least_squares", "minimize")
METHODS = ("Gauss-Newton", "Levenberg")


@cache
def tree(module: str) -> ast.Module:
    return ast.parse(FILES[module].read_text("utf-8"))


def lines(module: str) -> Counter[str]:
    """Lines of a module by kind."""
    text = FILES[module].read_text("utf-8").splitlines()
    kinds = ["comments" if line.strip().startswith("#") else "code" if line.strip() else "blank" for line in text]
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            kinds[node.lineno - 1 : node.end_lineno] = ["imports"] * (node.end_lineno - node.lineno + 1)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            first, last = node.body[0].lineno, node.body[0].end_lineno
            kinds[first - 1 : last] = ["docstrings"] * (last - first + 1)
    return Counter(kinds)


@cache
def imported(module: str) -> frozenset[str]:
    """Modules that a module imports, the one in which a name of a façade is made in place of the façade."""
    found = set()
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.ImportFrom) and node.module in FILES:
            found |= {home(node.module, name.name) for name in node.names}
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names if name.name in FILES}
    return frozenset(found)


def home(module: str, name: str) -> str:
    """The module in which a name that is imported from here is made."""
    if f"{module}.{name}" in FILES:
        return f"{module}.{name}"
    for node in ast.walk(tree(module)) if FILES[module].name == "__init__.py" else ():
        if isinstance(node, ast.ImportFrom) and node.module in FILES:
            for one in node.names:
                if (one.asname or one.name) == name:
                    return home(node.module, one.name)
    return module


def reached(module: str) -> set[str]:
    """Modules that one comes to from here; not by façades, which hold every name of their room."""
    found, left = set(), [module]
    while left:
        if (now := left.pop()) not in found:
            found.add(now)
            left += () if FILES[now].name == "__init__.py" else imported(now)
    return found


def integrates(node: ast.FunctionDef) -> bool:
    text = ast.unparse(ast.Module(body=node.body, type_ignores=[]))
    return "step" in text and "/ 6.0" in text and "2.0" in text


def fits(node: ast.FunctionDef) -> bool:
    called = (one.func for one in ast.walk(node) if isinstance(one, ast.Call))
    return any(isinstance(one, ast.Attribute) and one.attr in OPTIMISERS for one in called)


def begins_with_method(module: str, node: ast.Module | ast.FunctionDef) -> bool:
    text = (ast.get_docstring(node) or "").splitlines()
    return FILES[module].name != "__init__.py" and any(line.startswith(METHODS) for line in text)


def named(found: set[str]) -> str:
    return ", ".join(sorted(name.removeprefix("expdesign.") for name in found))


def main() -> None:
    by_kind = sum(map(lines, FILES), Counter())
    nodes = [(module, node) for module in FILES for node in ast.walk(tree(module))]
    classes = [node for _, node in nodes if isinstance(node, ast.ClassDef)]
    values = [
        one
        for one in classes
        if any("dataclass" in ast.dump(deco) or "sealed" in ast.dump(deco) for deco in one.decorator_list)
    ]
    functions = [(module, node) for module, node in nodes if isinstance(node, ast.FunctionDef)]
    sizes = sorted(sum(lines(module).values()) for module in FILES)
    own = {m for m, node in nodes if isinstance(node, ast.Module | ast.FunctionDef) and begins_with_method(m, node)}
    print("| what | number |\n|---|---|")
    for what, number in (
        ("files", len(FILES)),
        ("lines", by_kind.total()),
        *((f"of these {kind}", count) for kind, count in by_kind.most_common()),
        ("median lines of a file, most", f"{sizes[len(sizes) // 2]}, {sizes[-1]}"),
        ("deepest folder", max(len(path.relative_to(PACKAGE).parts) - 1 for path in FILES.values())),
        ("dataclasses, all classes", f"{len(values)}, {len(classes)}"),
        ("fields of dataclasses", sum(isinstance(item, ast.AnnAssign) for one in values for item in one.body)),
        ("integrators", named({f"{module}.{one.name}" for module, one in functions if integrates(one)})),
        ("fit engines of our own", named(own)),
        ("fits by SciPy's", named({module for module, one in functions if fits(one)})),
    ):
        print(f"| {what} | {number} |")
    commands = {path.stem: reached(f"expdesign.workflows.commands.{path.stem}")
                for path in sorted((PACKAGE / "workflows" / "commands").glob("[!_]*.py"))}  # fmt: skip
    times = Counter(module for found in commands.values() for module in found)
    print("\n| command's file | lines it comes to | of these its own |\n|---|---|---|")
    for name, found in commands.items():
        counts = {module: sum(lines(module).values()) for module in found}
        alone = sum(count for module, count in counts.items() if times[module] == 1)
        print(f"| {name} | {sum(counts.values())} | {alone} |")


if __name__ == "__main__":
    main()
