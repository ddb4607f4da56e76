"""Façades that load names on first use, so that a command imports only the packages it needs."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path


def load_on_use(package: str, file: str) -> tuple[Callable[[str], object], list[str]]:
    """The `__getattr__` and the `__all__` of a package whose file imports its names for type checkers only.

    Args:
        package: its `__name__`.
        file: its `__file__`, an `__init__.py`.

    Returns:
        A function that imports the module of a name, keeps the value in the package, and returns it; and all names.
    """
    inside = f"{package}."
    home = {
        alias.name: node.module
        for node in ast.walk(ast.parse(Path(file).read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module is not None and node.module.startswith(inside)
        for alias in node.names
    }

    def attribute(name: str) -> object:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(home[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return attribute, sorted(home)
