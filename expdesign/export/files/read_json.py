"""Results read back from the JSON files that commands write."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from expdesign.errors import FileError
from expdesign.input_files import check_ends


class Entry(BaseModel):
    """Entries that are read; what else a file holds is left aside."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False, extra="ignore")


Kind = TypeVar("Kind", bound=BaseModel)


def read_json(path: Path, kind: type[Kind], expected: str) -> Kind:
    """A file as a value.

    Args:
        path: of the file.
        kind: its entries.
        expected: the kind of file in words, e.g. "a plan.json as expdesign run writes it".

    Raises:
        FileError: the file is missing or garbled, or an entry is.
    """
    try:
        return kind.model_validate_json(read_text(path))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        if first["type"] == "json_invalid" or not first["loc"]:
            why = first["msg"].removeprefix("Invalid JSON: ")
            found_kind = "a TOML file" if path.suffix == ".toml" else f"no readable JSON ({why})"
            raise FileError(path, "", f"is {found_kind}, expected {expected}") from None
        problem = first["msg"][:1].lower() + first["msg"][1:]
        found = first.get("input")
        if isinstance(found, str | int | float | bool):
            problem = f"is {found!r}: {problem}"
        if first["type"] == "missing":
            problem = f"is missing, expected {expected}"
        raise FileError(path, ".".join(str(part) for part in first["loc"]), problem) from None


def read_text(path: Path) -> str:
    """The text of a result file.

    Raises:
        FileError: it is missing, cannot be read, or is no text.
    """
    check_ends(path, "a file as expdesign run writes it")
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise FileError(path, "", "does not exist") from None
    except UnicodeDecodeError:
        raise FileError(path, "", "is not UTF-8 text") from None
    except OSError as error:
        raise FileError(path, "", f"cannot be read: {error.strerror or error}") from None
