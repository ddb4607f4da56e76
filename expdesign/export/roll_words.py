"""Changes of roll in words, for the pages of diagnoses and watches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from expdesign.conventions import plus_minus
from expdesign.roll import G_MPS2, UNITS
from expdesign.roll.record import CAUSES, LOAD


def change_words(
    causes: Sequence[str],
    sizes: Sequence[float],
    stds: Sequence[float],
    *,
    load: tuple[float, float] | None,
    values: Mapping[str, float],
) -> str:
    """Causes with their sizes, as in `RollChange`; `values` are the parameters before."""
    return ", and ".join(
        _load(size, std, load) if cause == LOAD else _parameter(cause, size, std, values[cause])
        for cause, size, std in zip(causes, sizes, stds, strict=True)
    )


def _parameter(cause: str, size: float, std: float, value: float) -> str:
    share = f" ({100 * size / abs(value):+.3g} %)" if value else ""
    return f"{CAUSES[cause]}, {cause} by {plus_minus(size, std)} {UNITS[cause]}{share}"


def _load(size: float, std: float, load: tuple[float, float] | None) -> str:
    assert load is not None
    mass, height = load
    on = "on board" if mass > 0 else "taken off"
    return (
        f"{CAUSES[LOAD]}, a moment about the rotation axis of {plus_minus(-size, std)} kg m upwards, as of "
        f"{abs(mass):.3g} kg {on} at a height of {height:.3g} m"
    )


def stability_words(before: float, after: float, *, mass_kg: float, load: tuple[float, float] | None) -> str:
    """Righting moments [N m/rad] and metacentric heights, of a mass before and what was added."""
    total = mass_kg + (load[0] if load is not None else 0.0)
    heights = f"{before / (G_MPS2 * mass_kg):.3g} to {after / (G_MPS2 * total):.3g} m"
    return (
        f"Her righting moment goes from {before:.4g} to {after:.4g} N m/rad ({100 * (after / before - 1):+.3g} %), her "
        f"metacentric height from {heights}."
    )
