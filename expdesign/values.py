"""Frozen values that hold arrays: shapes checked against shared letters, arrays read-only.

A value with arrays is declared `@sealed(prior="p p", ...)`; one that makes or checks more at birth is a frozen
dataclass that calls `seal` in its `__post_init__`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import ArrayLike, NDArray

from expdesign.errors import ShapeError

Array = NDArray[np.float64]
Value = TypeVar("Value")
ASIDE = {"aside": True}  # metadata of a field that says how a value came about, on which no result depends


def readonly(values: ArrayLike) -> Array:
    """A read-only copy as floats; the array itself where it, and what it is a view of, are read-only already."""
    if _is_sealed(values):
        return np.asarray(values)
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


def closed(array: Array) -> Array:
    """The array, read-only from now on with what it is a view of, so that frozen values keep it without a copy."""
    view: object = array
    while isinstance(view, np.ndarray):
        view.setflags(write=False)
        view = view.base
    return array


def _is_sealed(values: object) -> bool:
    """Whether an array of floats is read-only, and so is what it is a view of."""
    while type(values) is np.ndarray and values.dtype == float and not values.flags.writeable:
        if values.base is None:
            return True
        values = values.base
    return False


def seal(value: object, **shapes: str) -> None:
    """Replace the named fields by read-only float arrays and check their shapes; those that are None stay it.

    Args:
        value: a frozen dataclass instance, in its `__post_init__`.
        shapes: field name to a shape in letters or digits, e.g. `prior="p p", pose="k 3"`; a letter has one size per
            value.

    Raises:
        ShapeError: naming the class, the field, the shape found and the one expected.
    """
    sizes: dict[str, int] = {}
    for name, letters in shapes.items():
        if getattr(value, name) is None:
            continue
        array = readonly(getattr(value, name))
        expected = letters.split()
        if len(expected) != array.ndim or not all(
            size == (int(letter) if letter.isdigit() else sizes.setdefault(letter, size))
            for letter, size in zip(expected, array.shape, strict=True)
        ):
            raise ShapeError(
                f"{type(value).__name__}.{name} has shape {array.shape}, expected ({letters}) with {sizes}"
            )
        object.__setattr__(value, name, array)


@dataclass_transform(eq_default=False, kw_only_default=True, frozen_default=True)
def sealed(**shapes: str) -> Callable[[type[Value]], type[Value]]:
    """A frozen dataclass with keywords, equal to itself alone, whose arrays are sealed at birth, as by `seal`."""

    def made(cls: type[Value]) -> type[Value]:
        cls.__post_init__ = lambda self: seal(self, **shapes)  # type: ignore[attr-defined]
        return dataclass(frozen=True, kw_only=True, eq=False)(cls)

    return made


def frozen_set(value: object, name: str, content: Any) -> None:
    """Set a field of a frozen value inside its `__post_init__`."""
    object.__setattr__(value, name, content)
