"""Forms made of the tables that read the files: their keys, help, choices and errors.

A value that is wrong is said beside its field and not written; one that is taken away leaves the file's default.
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Callable, Mapping
from typing import Any, Literal, get_args, get_origin

import tomlkit
from nicegui import ui
from pydantic.fields import FieldInfo

from expdesign.errors import FileError
from expdesign.scenario.tables import Entry, Table, check_table, read_toml
from expdesign.web.folder import Folder

Path = tuple[str | int, ...]
"""Keys from the whole file to a value; numbers count the tables of a list from 0."""


class Form:
    """A form on a part of a TOML file."""

    def __init__(
        self,
        folder: Folder,
        name: str,
        model: type[Table],
        *,
        kinds: Mapping[str, Mapping[str, type[Table]]] | None = None,
        check: Callable[[Mapping[str, Any], Entry], object] | None = None,
        changed: Callable[[], object] = lambda: None,
    ) -> None:
        """Of the file `name`, which `model` reads.

        Args:
            name: of the file, in the folder.
            model: of the whole file.
            kinds: key of a list of tables of several kinds -> kind -> its table.
            check: reads the tables of the file and raises a FileError where something is wrong; `model` alone when
                not given.
            changed: called after each change.
        """
        self._folder, self._name, self._model, self._changed = folder, name, model, changed
        self._kinds, self._check = kinds or {}, check or (lambda tables, entry: check_table(model, tables, entry))
        self._tables, self._open = read_toml(folder.path(name)), False

    def draw(self, *keys: str, skip: tuple[str, ...] = ()) -> None:
        """The fields of tables of the file, each table under its name; all of them where none is named.

        A table that is drawn alone is open.
        """
        self._open = len(keys) == 1
        for key, field in self._model.fields().items():
            if key in skip or (keys and key not in keys):
                continue
            self._draw_one((key,), field)

    def _draw_one(self, path: Path, field: FieldInfo) -> None:
        inner, kinds = _table_of(field.annotation), self._kinds.get(str(path[-1]), {})
        if kinds:
            self._draw_list(path, field, kinds)
        elif inner is None and self._value(path) and _is_numbers(field.annotation):
            self._draw_numbers(path, field)
        elif inner is None:
            self._draw_value(path, field)
        elif any(get_origin(part) is list for part in _parts(field.annotation)):
            self._draw_list(path, field, {"": inner})
        else:
            self._draw_table(path, field, inner)

    def _draw_table(self, path: Path, field: FieldInfo, inner: type[Table]) -> None:
        is_open = len(path) == 1 and self._open
        shown = ui.expansion(f"[{_dotted(path)}]", caption=field.description, value=is_open).classes("table")
        with shown, ui.element("div").classes("entries"):
            for key, part in inner.fields().items():
                self._draw_one((*path, key), part)

    def _draw_numbers(self, path: Path, field: FieldInfo) -> None:
        """A table of numbers whose keys are the file's own, as the parameters of a model."""
        shown = ui.expansion(f"[{_dotted(path)}]", caption=field.description).classes("table")
        with shown:
            with ui.element("div").classes("entries"):
                for key in self._value(path):
                    self._draw_one((*path, key), FieldInfo(annotation=float))
            ui.button(f"Add to [{_dotted(path)}]", on_click=lambda: self._ask(path, "name = value", path)).props(
                "flat dense"
            )

    def _draw_list(self, path: Path, field: FieldInfo, kinds: Mapping[str, type[Table]]) -> None:
        """Tables of a list; each is of the kind that it states, where there are several."""
        for number, row in enumerate(self._value(path) or ()):
            kind = row.get("kind", "") if len(kinds) > 1 else ""
            inner = kinds.get(kind, next(iter(kinds.values())))
            title = f"[[{_dotted(path)}]] {number + 1}{kind and f': {kind}'}"
            with ui.expansion(title, caption=inner.__doc__ if kind else field.description).classes("table"):
                with ui.element("div").classes("entries"):
                    for key, part in inner.fields().items():
                        if not (kind and key == "kind"):  # another kind has other keys: it is removed and added
                            self._draw_one((*path, number, key), part)
                ui.button("Remove", on_click=lambda number=number: self._remove((*path, number))).props("flat dense")
        with ui.row():
            for kind, inner in kinds.items():
                needed = [
                    key for key, part in inner.fields().items() if part.is_required() and not (kind and key == "kind")
                ]
                text = "\n".join([f'kind = "{kind}"'] * bool(kind) + [f"{key} = " for key in needed])
                ui.button(
                    f"Add {kind}" if kind else f"Add to [[{_dotted(path)}]]",
                    on_click=lambda text=text: self._ask(path, text, (*path, len(self._value(path) or ()))),
                ).props("flat dense")

    def _ask(self, path: Path, text: str, at: Path) -> None:
        """Ask for a table, as its keys only make sense together; what stands `at` that place is kept beside it."""
        with ui.dialog() as dialog, ui.card():
            ui.label(f"New in [{_dotted(path)}], in TOML")
            typed = ui.textarea(value=text).classes("toml").props(f'autogrow aria-label="New in {_dotted(path)}"')
            problem = ui.label().classes("wrong").props('role="alert"')

            def add() -> None:
                try:
                    table = tomllib.loads(typed.value)
                except tomllib.TOMLDecodeError as error:
                    problem.text = str(error)
                    return
                found = self._value(at)
                problem.text = self._set(at, {**found, **table} if found else table)
                if not problem.text:
                    ui.navigate.reload()

            with ui.row():
                ui.button("Add", on_click=add)
                ui.button("Cancel", on_click=dialog.close).props("flat")
        dialog.open()

    def _draw_value(self, path: Path, field: FieldInfo) -> None:
        with ui.column().classes("entry"):
            self._draw_entry(path, field)

    def _draw_entry(self, path: Path, field: FieldInfo) -> None:
        value, choices, label = self._value(path), _choices(field.annotation), str(path[-1])
        help_ = field.description or ""
        common: dict[str, Any] = {"label": label}
        note: ui.label
        if field.annotation is bool:
            shown: Any = ui.switch(label, value=bool(field.default if value is None else value))
            shown.on_value_change(lambda event: self._told(note, path, event.value))
        elif choices:
            names = {} if field.is_required() else {None: "not stated"}
            shown = ui.select({**names, **{choice: str(choice) for choice in choices}}, value=value, **common)
            shown.on_value_change(lambda event: self._told(note, path, event.value))
        else:
            text = "" if value is None else value if isinstance(value, str) else _toml(value)
            shown = ui.input(value=text, **common)
            words = any(part is str for part in _parts(field.annotation))
            shown.on("blur", lambda: self._told(note, path, *_typed(shown.value, words)))
            shown.on("keydown.enter", lambda: self._told(note, path, *_typed(shown.value, words)))
        shown.classes("field").props("dense")
        ui.label(f"{help_}{_default(field)}").classes("help")
        note = ui.label().classes("wrong").props('role="alert"')

    def _told(self, note: ui.label, path: Path, value: Any, problem: str = "") -> None:
        note.text = problem or self._set(path, value)

    def _value(self, path: Path) -> Any:
        found: Any = self._tables
        for key in path:
            try:
                found = found[key]
            except (KeyError, IndexError, TypeError):
                return None
        return found

    def _remove(self, path: Path) -> None:
        if not self._set(path, None):
            ui.navigate.reload()

    def _set(self, path: Path, value: Any) -> str:
        """Write a value, or take it away where it is None; what is wrong with it, or ""."""
        if value == self._value(path):
            return ""
        file = self._folder.path(self._name)
        tables = read_toml(file)
        try:
            put(tables, path, value)
            self._check(tables, Entry(file))
            self._folder.change(self._name, lambda content: put(content, path, value))
        except FileError as error:
            return f"{error.key}: {error.problem}" if error.key else str(error)
        self._tables = tables
        self._changed()
        return ""


def put(tables: Any, path: Path, value: Any) -> None:
    """Set a value in nested tables and make the tables around it; None takes it away."""
    for key, after in itertools.pairwise(path):
        if isinstance(key, str) and key not in tables:
            tables[key] = tomlkit.aot() if isinstance(after, int) else tomlkit.table()
        tables = tables[key]
    last = path[-1]
    if value is None:
        if isinstance(last, int) or last in tables:
            del tables[last]
    elif isinstance(last, int) and last == len(tables):
        table = tomlkit.table()
        table.update(value)
        tables.append(table)
    else:
        tables[last] = value


def _typed(text: str, words: bool) -> tuple[Any, str]:
    """A value as it was typed, and what is wrong with it."""
    text = (text or "").strip()
    if not text:
        return None, ""
    if words:
        return text, ""
    try:
        return tomllib.loads(f"value = {text}")["value"], ""
    except tomllib.TOMLDecodeError:
        return None, f"{text!r} is no number, list or table in TOML"


def _default(field: FieldInfo) -> str:
    """What stands for a value that is not given, in brackets, unless the help says so."""
    default = field.get_default(call_default_factory=True)
    if field.is_required() or default is None or default in ("", [], {}) or isinstance(default, Table):
        return ""
    return f" (default: {default if isinstance(default, str) else _toml(default)})"


def _toml(value: Any) -> str:
    if isinstance(value, Table):
        value = value.model_dump(exclude_none=True)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_toml(part)}" for key, part in value.items()) + "}"
    return str(tomlkit.item(value).as_string())


def _dotted(path: Path) -> str:
    return ".".join(str(key) for key in path if isinstance(key, str))


def _parts(annotation: Any) -> tuple[Any, ...]:
    """The types that an annotation allows, without None."""
    arguments = get_args(annotation)
    if get_origin(annotation) in (list, dict, Literal) or not arguments:
        return (annotation,)
    return tuple(part for one in arguments for part in _parts(one) if part is not type(None))


def _table_of(annotation: Any) -> type[Table] | None:
    for part in _parts(annotation):
        inner = get_args(part)[0] if get_origin(part) is list else part
        if isinstance(inner, type) and issubclass(inner, Table):
            return inner
    return None


def _is_numbers(annotation: Any) -> bool:
    """Whether it is a table of numbers by names."""
    return any(
        get_origin(part) is dict and not any(get_origin(one) is dict for one in get_args(part))
        for part in _parts(annotation)
    )


def _choices(annotation: Any) -> tuple[Any, ...]:
    return next((get_args(part) for part in _parts(annotation) if get_origin(part) is Literal), ())
