"""Values as plain numbers, texts, lists and tables of a file, and back by the types of their fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

Value = TypeVar("Value")


def saved(value: Any) -> Any:
    """Numbers, texts, lists and tables of a value, to the last bit; infinite numbers as texts."""
    if isinstance(value, np.ndarray):
        return saved(value.tolist())
    if isinstance(value, list | tuple):
        return [saved(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        return {field.name: saved(getattr(value, field.name)) for field in fields(value)}
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


def restored(kind: type[Value], table: Mapping[str, Any]) -> Value:
    """A value of a dataclass, read from what `saved` made of it; what is no field of it is left alone.

    Raises:
        KeyError, TypeError, ValueError: it is none.
    """
    kinds = _kinds_of(kind)  # type: ignore[arg-type]  # every type can be hashed
    return kind(**{name: _read(kinds[name], table[name]) for name in kinds})


@cache
def _kinds_of(kind: type[Any]) -> dict[str, Any]:
    """Name of each field -> its type."""
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind)}


def _read(kind: Any, given: Any) -> Any:
    """What is given, as a type; of several dataclasses, as the one whose fields it has."""
    origin, kinds = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        if given is None and NoneType in kinds:
            return None
        several = [one for one in kinds if one is not NoneType]
        own = several if len(several) == 1 else [one for one in several if _kinds_of(one).keys() == given.keys()]
        if len(own) != 1:
            raise TypeError(f"{given!r} is none of {kinds}")
        return _read(own[0], given)
    if origin is tuple:
        each = kinds[:1] * len(given) if kinds[1:] == (...,) else kinds
        return tuple(_read(one, item) for one, item in zip(each, given, strict=True))
    if origin is dict:
        return {name: _read(kinds[1], item) for name, item in given.items()}
    if is_dataclass(kind) and isinstance(kind, type):
        return restored(kind, given)
    if origin is np.ndarray:
        return np.array(given, dtype=float)
    if kind is float:
        return float(given)
    if not isinstance(given, kind):
        raise TypeError(f"{given!r} is no {kind}")
    return given
