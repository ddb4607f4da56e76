"""Frozen values that hold arrays: shapes checked against shared letters, arrays read-only.

A value with arrays is declared `@dataclass(frozen=True, kw_only=True, eq=False)` and calls `seal` once, at birth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from expdesign.errors import ShapeError

Array = NDArray[np.float64]
ASIDE = {"aside": True}
"""Metadata of a field that says how a value came about, on which no result depends."""


def readonly(values: ArrayLike) -> Array:
    """A read-only copy as floats; the array itself where it, and what it is a view of, are read-only already."""
    if _sealed(values):
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


def _sealed(values: object) -> bool:
    """Whether an array of floats is read-only, and so is what it is a view of."""
    while type(values) is np.ndarray and values.dtype == float and not values.flags.writeable:
        if values.base is None:
            return True
        values = values.base
    return False


def seal(value: object, **shapes: str) -> None:
    """Replace the named fields by read-only float arrays and check their shapes.

    Args:
        value: a frozen dataclass instance, in its `__post_init__`.
        shapes: field name to a shape in letters or digits, e.g. `prior="p p", pose="k 3"`; a letter has one size per
            value.

    Raises:
        ShapeError: naming the class, the field, the shape found and the one expected.
    """
    sizes: dict[str, int] = {}
    for name, letters in shapes.items():
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


def frozen_set(value: object, name: str, content: Any) -> None:
    """Set a field of a frozen value inside its `__post_init__`."""
    object.__setattr__(value, name, content)
