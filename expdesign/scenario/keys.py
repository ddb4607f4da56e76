"""The keys of a file, from the descriptions of its tables."""

from __future__ import annotations

import types
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from expdesign.scenario.tables import LARGEST, Table, shown

KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text", dict: "a table"}
BOUNDS = {"ge": "at least", "gt": "more than", "le": "at most", "lt": "less than"}
FILES = {"min_length": "at least", "max_length": "at most"}


@dataclass(frozen=True, kw_only=True)
class Key:
    """One key of a file."""

    name: str  # dotted; entries of a list of tables are marked as in "no_go[].name"
    meaning: str  # its description, with unit
    default: str  # as in a file; "required"; or "optional", for one that has no value where it is not given
    allowed: str  # its allowed values


def keys_of(model: type[Table], prefix: str = "") -> tuple[Key, ...]:
    """All keys of a table and of the tables in it, in the order of the model."""
    return tuple(_keys(model, prefix))


def _keys(model: type[Table], prefix: str) -> Iterator[Key]:
    for name, field in model.fields().items():
        inner, listed = table_in(field.annotation)
        yield Key(
            name=f"{prefix}{name}",
            meaning=field.description or "",
            default=_default(field, inner),
            allowed=_allowed(field.annotation, field.metadata),
        )
        if inner is not None:
            yield from _keys(inner, f"{prefix}{name}{'[]' if listed else ''}.")


def table_in(annotation: Any) -> tuple[type[Table] | None, bool]:
    """The table that a key holds, and whether it holds a list of them; None for a plain value."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return annotation, False
    for part in get_args(annotation):
        inner, listed = table_in(part)
        if inner is not None:
            return inner, listed or get_origin(annotation) is list
    return None, False


def _default(field: FieldInfo, inner: type[Table] | None) -> str:
    if field.is_required():
        return "required"
    value = None if inner is not None else field.get_default(call_default_factory=True, validated_data={})
    if value is None or value in ({}, [], ""):
        return "optional"
    return f"[{', '.join(map(shown, value))}]" if isinstance(value, list) else shown(value)


def _allowed(annotation: Any, metadata: list[Any]) -> str:
    """A few words for a type and its limits."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _allowed(arguments[0], [*arguments[1:], *metadata])
    if origin in (Union, types.UnionType):
        return " or ".join(_allowed(part, metadata) for part in arguments if part is not type(None))
    if origin is Literal:
        return " or ".join(map(shown, arguments))
    limits = [part for item in metadata for part in getattr(item, "metadata", [item])]
    if origin is list:
        sizes = {getattr(item, name) for item in limits for name in FILES if getattr(item, name, None) is not None}
        count = f"{sizes.pop()} " if len(sizes) == 1 and len(limits) > 1 else ""
        item, *limits_of_item = _allowed(arguments[0], []).removeprefix("a ").split(", ")
        return ", ".join([f"a list of {count}{item if item == 'text' else _plural(item)}", *limits_of_item])
    if origin is dict:
        return f"a table of name = {_allowed(arguments[1], []).removeprefix('a ')}"
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return "a table"
    words = [
        f"{word} {getattr(item, bound):.5g}"
        for item in limits
        for bound, word in BOUNDS.items()
        if abs(getattr(item, bound, None) or 0 if hasattr(item, bound) else LARGEST) < LARGEST
    ]
    return ", ".join([KINDS.get(annotation, "any"), *words])


def _plural(kind: str) -> str:
    """`list of 2 numbers` -> `lists of 2 numbers`."""
    if kind.startswith("whole number"):
        return kind.replace("whole number", "whole numbers", 1)
    first, *rest = kind.split(" ", 1)
    return " ".join([f"{first}s", *rest])
