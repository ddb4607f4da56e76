"""Names of parameters, and correlations of pairs of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from expdesign.scenario.tables import Entry, offer, shown


def checked_correlation(
    given: Mapping[str, Mapping[str, float]], names: Sequence[str], entry: Entry
) -> dict[tuple[str, str], float]:
    """Correlations of pairs of parameters.

    Raises:
        FileError: an unknown parameter, a pair given twice, or a correlation beyond -1 and 1.
    """
    check_names(given, names, entry)
    found: dict[tuple[str, str], float] = {}
    for one, row in given.items():
        check_names(row, names, entry.at(one))
        for other, value in row.items():
            if one == other or (other, one) in found:
                raise entry.at(one).at(other).error("is given already, expected each pair of parameters once")
            if not -1.0 <= value <= 1.0:
                raise entry.at(one).at(other).error(f"is {value:g}, expected -1 to 1")
            found[one, other] = value
    return found


def check_names(given: Iterable[str], names: Sequence[str], entry: Entry) -> None:
    """Raise FileError for a name that is no parameter of the structure."""
    for name in given:
        if name not in names:
            problem = f"{shown(name)} is not a parameter of the structure, {offer(name, tuple(names))}"
            raise entry.error(problem)
