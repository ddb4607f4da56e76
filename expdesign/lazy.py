"""Façades that load names on first use, so that a command imports only the rooms it needs."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping


def load_on_use(package: str, homes: Mapping[str, tuple[str, ...]]) -> Callable[[str], object]:
    """The `__getattr__` of a package.

    Args:
        package: its `__name__`.
        homes: module inside the package -> public names that it defines.

    Returns:
        A function that imports the module of a name, keeps the value in the package, and returns it.
    """
    home = {name: module for module, names in homes.items() for name in names}

    def attribute(name: str) -> object:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(f"{package}.{home[name]}"), name)
        setattr(sys.modules[package], name, value)
        return value

    return attribute
