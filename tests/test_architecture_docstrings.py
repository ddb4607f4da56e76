"""Docstrings name what exists: every argument and attribute that one describes."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "expdesign"
ENTRY = re.compile(r"^( +)([A-Za-z_][\w, ]*): ")  # indented names, before what they are


def described(docstring: str, section: str) -> list[str]:
    """Names in a section: those of its least indented lines."""
    _, found, rest = docstring.partition(f"{section}:\n")
    if not found:
        return []
    block = re.split(r"\n[ ]*\n|\n +[A-Z]\w+:\n", rest)[0]
    entries = [match for line in block.splitlines() if (match := ENTRY.match(line))]
    least = min((len(match[1]) for match in entries), default=0)
    return [name.strip() for match in entries if len(match[1]) == least for name in match[2].split(",")]


def arguments(node: ast.FunctionDef) -> set[str]:
    own = node.args
    every = [*own.posonlyargs, *own.args, *own.kwonlyargs, *filter(None, (own.vararg, own.kwarg))]
    return {one.arg for one in every}


def attributes(node: ast.ClassDef) -> set[str]:
    """Fields, properties, and what methods set."""
    names = set()
    for item in ast.walk(node):
        match item:
            case ast.AnnAssign(target=ast.Name(id=name)) | ast.FunctionDef(name=name):
                names.add(name)
            case ast.Attribute(value=ast.Name(id="self"), attr=name, ctx=ast.Store()):
                names.add(name)
            case ast.Assign(targets=targets):
                names |= {one.id for one in targets if isinstance(one, ast.Name)}
    return names


@cache
def nodes(path: Path) -> list[ast.AST]:
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def unknown(path: Path) -> Iterator[str]:
    """Names in the docstrings of a file that do not exist."""
    for node in nodes(path):
        match node:
            case ast.FunctionDef():
                names, section = arguments(node), "Args"
            case ast.ClassDef(bases=[]):
                names, section = attributes(node), "Attributes"
            case _:
                continue
        for name in described(ast.get_docstring(node) or "", section):
            if name not in names:
                yield f"{path.relative_to(PACKAGE)}: {node.name}: {name}"


FILES = sorted(PACKAGE.rglob("*.py"))


def test_what_docstrings_name_exists() -> None:
    assert [name for path in FILES for name in unknown(path)] == []


def test_what_texts_name_of_a_class_exists() -> None:
    """`Plan.legs`, in docstrings and comments, of every class of the package."""
    known: dict[str, set[str]] = {}
    for node in (node for path in FILES for node in nodes(path)):
        if isinstance(node, ast.ClassDef):
            known.setdefault(node.name, set()).update(attributes(node))
    named = [
        (path.name, *found)
        for path in FILES
        for found in re.findall(r"`([A-Z]\w+)\.(\w+)`", path.read_text(encoding="utf-8"))
        if found[0] in known
    ]
    assert len(named) > 10
    assert [item for item in named if item[2] not in known[item[1]]] == []
