"""From TOML files to checked tables; every mistake becomes one `FileError`.

A table is a pydantic model that refuses unknown keys, other types, not-a-numbers and infinities; integers are accepted
as floats. A field's description is the meaning of the key, in messages and in `expdesign explain`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from expdesign.errors import FileError, nearest
from expdesign.input_files import read_text

LARGEST = 1e12  # largest accepted number, far beyond any length, time or speed of a trial
MOST_NAMED = 240  # characters of all known names that are still listed beside the nearest one

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST)]
FASTEST_MPS, FASTEST_RADPS = 100.0, 5.0  # no vessel goes or turns as fast
Speed = Annotated[float, Field(ge=-FASTEST_MPS, le=FASTEST_MPS)]
PositiveSpeed = Annotated[float, Field(gt=0, le=FASTEST_MPS)]
YawRate = Annotated[float, Field(ge=-FASTEST_RADPS, le=FASTEST_RADPS)]
Text = Annotated[str, Field(min_length=1)]


class Table(BaseModel):
    """Base of all file tables."""

    topic: ClassVar[str] = ""  # of `expdesign explain`, for whole files

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @classmethod
    def fields(cls) -> Mapping[str, FieldInfo]:
        """Keys as they stand in files, with their meanings."""
        return {field.alias or name: field for name, field in cls.model_fields.items()}


T = TypeVar("T", bound=Table)


def same_keys(table: Table, kind: type) -> dict[str, Any]:
    """What a table says of the fields of a dataclass that have the names of its keys; lists are tuples."""
    given = {item.name: getattr(table, item.name) for item in fields(kind) if item.name in type(table).model_fields}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}


@dataclass(frozen=True)
class Entry:
    """A place in a file, for messages."""

    path: Path  # the file
    key: str = ""  # dotted key, "" for the whole file

    def at(self, key: str) -> Entry:
        """A key inside this table."""
        return Entry(self.path, f"{self.key}.{key}" if self.key else key)

    def item(self, number: int) -> Entry:
        """An entry of this list, counted from 1."""
        return Entry(self.path, f"{self.key}[{number}]")

    def error(self, problem: str) -> FileError:
        """The error with this place and problem."""
        return FileError(self.path, self.key, problem)

    def unknown(self, name: str, known: Iterable[str]) -> FileError:
        """The error for a name that is not in the list it must come from."""
        return self.error(f"is {shown(name)}, {offer(name, tuple(known))}")

    def file(self, named: str) -> Path:
        """The file that this entry names, relative to the file that contains it.

        Raises:
            FileError: it does not exist.
        """
        target = self.path.parent / named
        try:
            found = target.exists()
        except (OSError, ValueError):
            found = False
        if not found:
            raise self.error(f"names {shown(named)}, but {_one_line(str(target))!r} does not exist")
        return target


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file, unchecked.

    Raises:
        FileError: unreadable, or not TOML; the message gives the line.
    """
    text = read_text(path, "a TOML file")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(path, "", f"is not valid TOML: {_one_line(str(error))}") from None
    except (RecursionError, ValueError) as error:
        raise FileError(path, "", f"is not readable TOML: {_one_line(str(error))}") from None


def check_table(model: type[T], data: object, entry: Entry) -> T:
    """One table as its model.

    Raises:
        FileError: the first mistake; mistyped keys come before missing ones.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        if not entry.key and (other := _other_kind(model, data)):
            kinds = f"has the keys of a file of kind {other!r}, expected one of kind {model.topic!r}"
            raise entry.error(f"{kinds}{see(model.topic)}") from None
        problems = sorted(error.errors(), key=lambda problem: problem["type"] != "extra_forbidden")
        key, text = _explain(model, problems[0])
        raise (entry.at(key) if key else entry).error(text) from None


def _other_kind(model: type[Table], data: object) -> str:
    """The topic of another kind of file that has all keys of this one; "" where these are the model's, or nobody's."""
    if not model.topic or not isinstance(data, Mapping) or not data or set(data) <= set(model.fields()):
        return ""
    kinds = [kind for kind in Table.__subclasses__() if kind.topic not in ("", model.topic)]
    return next((kind.topic for kind in kinds if set(data) <= set(kind.fields())), "")


def shown(value: object) -> str:
    """A value as the user wrote it, on one line and not too long."""
    match value:
        case bool():
            return "true" if value else "false"
        case float():
            return f"{value:.12g}"
        case dict():
            return "a table"
        case list():
            return "a list" if value else "an empty list"
        case str():
            return repr(value if len(value) <= 60 else value[:57] + "...")
    text = _one_line(str(value))
    return text if len(text) <= 60 else text[:57] + "..."


def _explain(model: type[Table], problem: ErrorDetails) -> tuple[str, str]:
    """Dotted key and text of one pydantic problem."""
    place, kind, found = problem["loc"], problem["type"], problem.get("input")
    key, limits = _dotted(place), problem.get("ctx", {})
    if kind == "extra_forbidden":
        return key, f"is not a known key, {offer(str(place[-1]), _keys_at(model, place[:-1]))}{see(model.topic)}"
    meaning = _description(model, place)
    if kind == "missing":
        return key, f"is missing{f', expected {meaning}' if meaning else ''}{see(model.topic)}"
    text = f"is {shown(found)}, expected {_expected(kind, limits, found)}"
    return key, f"{text}: {meaning}{see(model.topic)}" if meaning else text


def see(topic: str) -> str:
    """A reference to `expdesign explain` for messages, or ""."""
    return f" (see expdesign explain {topic})" if topic else ""


def _expected(kind: str, limits: dict[str, Any], found: object) -> str:
    if kind in BOUND_WORDS:
        word, limit = BOUND_WORDS[kind]
        return f"{word} {float(limits[limit]):.6g}"
    if kind == "literal_error":
        return str(limits["expected"])
    if kind == "too_short":
        return f"at least {limits['min_length']} {'entry' if limits['min_length'] == 1 else 'entries'}"
    if kind == "too_long":
        return f"at most {limits['max_length']} entries"
    if kind == "float_type" and isinstance(found, str):
        return "a number, without quotes"
    return KIND_WORDS.get(kind, f"something else ({kind.replace('_', ' ')})")


BOUND_WORDS = {
    "greater_than": ("more than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}
KIND_WORDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "finite_number": "a finite number",
    "string_type": "text in quotes",
    "string_too_short": "text that is not empty",
    "bool_type": "true or false",
    "list_type": "a list in [ ]",
    "dict_type": "a table",
    "model_type": "a table",
}

UNION_PARTS = ("int", "constrained-str")  # steps of a place that name an alternative type, no key


def _dotted(place: Iterable[str | int]) -> str:
    """A place in a file, e.g. ("actuators", 1, "kind") -> "actuators[2].kind"."""
    text = ""
    for step in place:
        if step in UNION_PARTS:
            continue
        if isinstance(step, int):
            text += f"[{step + 1}]"
        else:
            plain = re.fullmatch(r"[\w-]+", step)
            text += f"{'.' if text else ''}{step if plain else repr(step[:60])}"
    return text


def _model_at(model: type[Table], place: Iterable[str | int]) -> type[Table] | None:
    found: type[Table] | None = model
    for step in place:
        if isinstance(step, str) and found is not None:
            field = found.fields().get(step)
            found = _model_in(field.annotation) if field else None
    return found


def _model_in(annotation: Any) -> type[Table] | None:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return annotation
    return next((found for part in get_args(annotation) if (found := _model_in(part))), None)


def _keys_at(model: type[Table], place: Iterable[str | int]) -> tuple[str, ...]:
    table = _model_at(model, place)
    return tuple(table.fields()) if table else ()


def _description(model: type[Table], place: tuple[str | int, ...]) -> str:
    """The meaning of the key at a place, or of the nearest key around it."""
    names = [step for step in place if isinstance(step, str)]
    for depth in range(len(names), 0, -1):
        table = _model_at(model, names[: depth - 1])
        field = table.fields().get(names[depth - 1]) if table else None
        if field is not None:
            return field.description or ""
    return ""


def offer(name: str, known: tuple[str, ...]) -> str:
    """The nearest known name, if one is near, and all of them where these still make one line."""
    if not known:
        return "expected none, as there is nothing here to name"
    near = nearest(name, known)
    names = ", ".join(known)
    if near is None:
        return f"expected one of {names}"
    return f"did you mean {near!r}?" + (f" (known: {names})" if len(names) <= MOST_NAMED else "")


def _one_line(text: str) -> str:
    return " ".join(text.split())
