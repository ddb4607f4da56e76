"""Which columns of a file are used, and whether they are enough."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from expdesign.errors import FileError, nearest
from expdesign.records.file.names import LABEL, PLANNED, REACHED, Source, Unitless, input_name, is_input, meaning

PAIRS = (
    ("north_m", "east_m"),
    ("lat_deg", "lon_deg"),
    ("wind_u_mps", "wind_v_mps"),
    ("wind_speed_mps", "wind_angle_rad"),
)
INSTEAD = (("lat_deg", "north_m"), ("lon_deg", "north_m"))
"""A column that is not used when the other one is there."""

MOST_NAMED = 8
"""Unknown columns, in a message."""

Sources = dict[str, Source]


@dataclass(frozen=True)
class Inputs:
    """The inputs a file must give."""

    columns: tuple[str, ...]  # their columns, e.g. ("n1_rps", "rudder1_rad").
    whose: str  # who takes or gives them, for messages, e.g. "the vessel".


def choose_columns(path: Path, header: tuple[str, ...], *, inputs: Inputs | None) -> tuple[Sources, tuple[str, ...]]:
    """The columns to read, by the contract's names, and notes on those that are converted or ignored.

    Args:
        path: for messages.
        header: names in the file.
        inputs: what must be there, or None for all inputs in the file.

    Raises:
        FileError: time or inputs are missing, a pair is incomplete, a known quantity has no unit or stands there twice.
    """
    meanings = [meaning(name, column) for column, name in enumerate(header)]
    used = _one_each(path, [source for source in meanings if isinstance(source, Source)])
    wanted = _wanted(path, header, used, inputs)
    _refuse_unitless(path, [name for name in meanings if isinstance(name, Unitless)], used, wanted)
    if "time_s" not in used:
        raise FileError(path, "row 1", f"names no time_s, expected it{mistyped('time_s', header)}")
    for pair in PAIRS:
        _check_pair(path, used, pair, header)
    chosen = {
        name: source
        for name, source in used.items()
        if not (is_input(own := input_name(name)) and own not in wanted)
        and not any(name == a and b in used for a, b in INSTEAD)
    }
    _check_planned(path, chosen, wanted)
    return chosen, (*_conversions(chosen), *_ignored(header, chosen, meanings))


def mistyped(name: str, header: Iterable[str]) -> str:
    """A hint at the unknown column that may have been meant, or ""."""
    unknown = [other for column, other in enumerate(header) if other and meaning(other, column) is None]
    near = nearest(name, unknown)
    return f" (is {near} a misspelling?)" if near else ""


def _one_each(path: Path, sources: Iterable[Source]) -> Sources:
    """One source per quantity; the contract's own name wins."""
    used: Sources = {}
    for source in sorted(sources, key=lambda source: (source.header != source.name, source.column)):
        other = used.setdefault(source.name, source)
        if other is not source and not other.exact:
            problem = f"gives {source.name} twice, as {other.header} and {source.header}, expected one of them"
            raise FileError(path, "row 1", problem)
    return dict(sorted(used.items(), key=lambda item: item[1].column))


def _wanted(path: Path, header: tuple[str, ...], used: Sources, inputs: Inputs | None) -> tuple[str, ...]:
    """Names of the input columns to read, all of them there or refused later for want of a unit."""
    there = tuple(dict.fromkeys(input_name(name) for name in used if is_input(name.removeprefix(REACHED))))
    if inputs is None:
        if there:
            return there
        expected = "tau_x tau_y tau_psi (in any unit, also throttle or PWM), or n1_rps a1_rad rudder1_rad ..."
        unknown = [name for column, name in enumerate(header) if name and meaning(name, column) is None]
        found = f"; unknown are {', '.join(unknown[:MOST_NAMED])}" if unknown else ""
        raise FileError(path, "row 1", f"names no inputs, expected {expected}{found}")
    meanings = [meaning(name, column) for column, name in enumerate(header)]
    unitless = {name for known in meanings if isinstance(known, Unitless) for name in known.names}
    missing = [name for name in inputs.columns if not {name, REACHED + name} & used.keys() and name not in unitless]
    if missing:
        found = f"the file gives {', '.join(there) or 'none'}"
        problem = f"names no {' '.join(missing)}, expected every input of {inputs.whose}; {found}"
        raise FileError(path, "row 1", problem + mistyped(missing[0], header))
    return inputs.columns


def _refuse_unitless(path: Path, names: Iterable[Unitless], used: Sources, wanted: tuple[str, ...]) -> None:
    for name in names:
        own = name.names[0]
        if own not in used and (own in wanted or not is_input(own)):
            raise FileError(path, "row 1", f"names {name.header} without a unit, expected {' or '.join(name.names)}")


def _check_pair(path: Path, used: Sources, pair: tuple[str, str], header: tuple[str, ...]) -> None:
    there = [name for name in pair if name in used]
    if len(there) == 1:
        missing = pair[1 - pair.index(there[0])]
        problem = f"names {used[there[0]].header} but no {missing}, expected both{mistyped(missing, header)}"
        raise FileError(path, "row 1", problem)


def _check_planned(path: Path, chosen: Sources, wanted: tuple[str, ...]) -> None:
    there = [name for name in chosen if name.startswith(PLANNED)]
    missing = [PLANNED + name for name in wanted if PLANNED + name not in chosen]
    if there and missing:
        problem = f"names {chosen[there[0]].header} but no {' '.join(missing)}, expected all or none of them"
        raise FileError(path, "row 1", problem)


def _conversions(chosen: Sources) -> list[str]:
    changed = [source for source in chosen.values() if not source.exact]
    return [
        f"{source.header} is read as {source.name}" + (f", times {source.factor:.6g}" if source.factor != 1.0 else "")
        for source in changed
    ]


def _ignored(header: tuple[str, ...], chosen: Sources, meanings: list[Source | Unitless | None]) -> list[str]:
    used = {source.column for source in chosen.values()}
    used |= {column for column, name in enumerate(header) if name == LABEL}
    extra = [name or f"column {column + 1}" for column, name in enumerate(header) if column not in used]
    return [f"ignored {', '.join(extra)}"] if extra else []
