"""Numbers in explanations."""

from __future__ import annotations

import math

from expdesign.diagnosis.causes.candidate import Values

PLUS_MINUS = "\N{PLUS-MINUS SIGN}"


def rounded(value: float, std: float) -> str:
    """A value to the second digit of its standard error."""
    if not (std > 0 and math.isfinite(std)):
        return f"{value:.4g}"
    decimals = max(0, 1 - math.floor(math.log10(std)))
    if decimals > 5:
        return f"{value:.3g} {PLUS_MINUS} {std:.2g}"
    return f"{value:.{decimals}f} {PLUS_MINUS} {std:.{decimals}f}"


def listed(values: Values, unit: str = "") -> str:
    """Every estimate with the last part of its key."""
    return ", ".join(f"{key.split(':')[-1]} {rounded(value, std)}{unit}" for key, (value, std) in values.items())


def first(values: Values) -> tuple[str, float, float]:
    """Key, value and standard error of the first estimate."""
    key, (value, std) = next(iter(values.items()))
    return key, value, std
