"""Variants side by side, as values, as JSON and in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.export.files import entry, strict_json
from expdesign.export.words import NOTICED, percent, significant
from expdesign.values import Array

DAY = ("day_s", "day_median_s", "day_95_s")
"""Keys of a plan's length from start to goal, as planned and in simulated trials."""

SAME_S = 3.0  # difference of days that is zero in tenths of a minute [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One variant, or the scenario itself."""

    name: str  # of the scenario
    changes: tuple[str, ...] = ()  # differences from the scenario, one line each
    problem: str = ""  # why there is no result, or ""
    criterion: str = ""  # of the design
    runs: Mapping[str, int]  # whole runs by primitive, only those used
    informative_s: float = 0.0  # time of all runs [s]
    gap_relative: float = 0.0  # of the certificate
    efficiencies: Mapping[str, float]  # criterion -> efficiency of the whole runs against that criterion's own optimum
    parameters: tuple[str, ...] = ()  # estimated ones
    covariance: Array  # (p, p) expected of estimates from the runs alone
    plan: Mapping[str, object]  # numbers of the planned trial, units in the names; empty when none was planned
    # (p, p) inverse information of the whole planned track, in units of the noise; None where it is not known
    track: Array | None = None
    # (informative time [s], (p, p) covariance) of the optimal runs in shorter and longer times
    times: tuple[tuple[float, Array], ...] = ()
    legs_count: bool = False  # whether the accuracy asked for is that of the whole track, not of the runs alone
    remarks: tuple[str, ...] = ()  # what its files state and it does not use, or takes as certain; one line each

    @property
    def std(self) -> Array:
        """(p,) expected standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


@dataclass(frozen=True, kw_only=True)
class Against:
    """A variant against the first case, on the parameters that both estimate."""

    common: tuple[str, ...]  # those parameters
    ratios: tuple[float, ...]  # (c,) standard deviation over the first case's
    accuracy: float  # ratio of information determinants to the power 1/c: 2 means half the variance
    # informative time in which the runs of the variant, in the same proportions, are as accurate as the first case [s];
    # None where whole tracks are compared, because legs count in one of the two
    same_accuracy_s: float | None
    # ratio of information, as `accuracy`, of the whole tracks, legs included; None where they are not known
    track: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class WhatIfContent:
    """The values that the page shows."""

    cases: tuple[Case, ...]  # the scenario first, then its variants
    planned: bool  # whether trials were planned

    def against(self, case: Case) -> Against | None:
        """A case against the first, or None when one of them has no result or they share no parameter."""
        first = self.cases[0]
        common = tuple(name for name in first.parameters if name in case.parameters)
        if first.problem or case.problem or not common:
            return None
        mine, theirs = (_part(item, item.covariance, common) for item in (case, first))
        track, legs_count = None, False
        if case.track is not None and first.track is not None:
            whole = _part(case, case.track, common), _part(first, first.track, common)
            track, legs_count = _gain(*whole), case.legs_count or first.legs_count
            mine, theirs = whole if legs_count else (mine, theirs)
        accuracy = _gain(mine, theirs)
        return Against(
            common=common,
            ratios=tuple(np.sqrt(np.diag(mine) / np.diag(theirs)).tolist()),
            accuracy=accuracy,
            same_accuracy_s=None if legs_count else case.informative_s / accuracy,
            track=track,
        )

    def curve(self, case: Case) -> tuple[tuple[float, float], ...]:
        """(informative time [s], standard deviation over the scenario's, geometric mean of directions) of a case."""
        first = self.cases[0]
        common = tuple(name for name in first.parameters if name in case.parameters)
        if first.problem or case.problem or not common:
            return ()
        theirs = _part(first, first.covariance, common)
        known = sorted((*case.times, (case.informative_s, case.covariance)), key=lambda item: item[0])
        return tuple((time_s, _gain(_part(case, mine, common), theirs) ** -0.5) for time_s, mine in known)


def _part(case: Case, covariance: Array, names: tuple[str, ...]) -> Array:
    chosen = [case.parameters.index(name) for name in names]
    return np.asarray(covariance[np.ix_(chosen, chosen)])


def _gain(mine: Array, theirs: Array) -> float:
    """Ratio of the determinants of two covariances (c, c), to the power 1/c."""
    scale = np.sqrt(np.outer(np.diag(theirs), np.diag(theirs)))
    gain = np.linalg.slogdet(theirs / scale)[1] - np.linalg.slogdet(mine / scale)[1]
    return float(np.exp(gain / len(mine)))


def explanations(content: WhatIfContent) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """(case, sentences) of every variant, and of the scenario where something is to be said of it."""
    first = content.cases[0]
    said = [
        (first.name, _remarks(first)),
        *((case.name, tuple(_sentences(content, case))) for case in content.cases[1:]),
    ]
    return tuple((name, sentences) for name, sentences in said if sentences)


def _remarks(case: Case) -> tuple[str, ...]:
    return tuple(f"Note: {line}." for line in case.remarks)


def _sentences(content: WhatIfContent, case: Case) -> Iterator[str]:
    first = content.cases[0]
    if case.problem:
        yield f"No result: {case.problem}."
        return
    against = content.against(case)
    if against is None:
        yield "It cannot be compared with the scenario, because they have no common parameter."
        return
    yield _accuracy(first, case, against)
    if case.legs_count and not content.planned:
        yield "These durations only state its accuracy; the shortest day has other runs, and --plan finds them."
    yield from _parameters(against)
    yield from _runs(first, case)
    missing = [name for name in first.parameters if name not in case.parameters]
    added = [name for name in case.parameters if name not in first.parameters]
    if missing:
        yield f"It does not estimate {', '.join(missing)}."
    if added:
        yield f"It also estimates {', '.join(added)}."
    yield from _plan(first, case, against)
    yield from (sentence for sentence in _remarks(case) if sentence not in _remarks(first))


def _accuracy(first: Case, case: Case, against: Against) -> str:
    minutes = case.informative_s / 60
    if against.same_accuracy_s is None:
        return f"Its runs take {minutes:.1f} min. Legs count in its accuracy, so whole days are compared."
    theirs = f"that the scenario's runs collect in {first.informative_s / 60:.1f} min"
    if abs(against.accuracy - 1) < NOTICED:
        return f"In {minutes:.1f} min its runs collect the information {theirs}."
    return (
        f"In {minutes:.1f} min its runs collect {_ratio(against.accuracy)} times the information {theirs}. "
        f"The same accuracy takes {_minutes(against.same_accuracy_s)} min."
    )


def _minutes(seconds: float) -> str:
    return f"{seconds / 60:.1f}" if seconds >= SAME_S else significant(seconds / 60, 1)


def _ratio(value: float) -> str:
    return f"{value:.2f}" if value >= 0.1 else significant(value, 2)


def _parameters(against: Against) -> Iterator[str]:
    ratios = np.array(against.ratios)
    if np.abs(ratios - 1).max() < NOTICED:
        yield f"No standard deviation changes by {percent(NOTICED)} or more."
        return
    best, worst = int(ratios.argmin()), int(ratios.argmax())
    if ratios.max() / ratios.min() < 1 + 2 * NOTICED:
        yield f"All standard deviations are about {_ratio(float(np.median(ratios)))} times those of the scenario."
        return
    least, most = (f"{_ratio(float(ratios[place]))} ({against.common[place]})" for place in (best, worst))
    yield f"Standard deviations are between {least} and {most} times those of the scenario."


def _runs(first: Case, case: Case) -> Iterator[str]:
    names = dict.fromkeys((*first.runs, *case.runs))
    changes = {name: case.runs.get(name, 0) - first.runs.get(name, 0) for name in names}
    more = [f"{count} more of {name}" for name, count in changes.items() if count > 0]
    less = [f"{-count} fewer of {name}" for name, count in changes.items() if count < 0]
    if more or less:
        yield f"Runs: {', '.join((*more, *less))}."


def _plan(first: Case, case: Case, against: Against) -> Iterator[str]:
    key = "day_s"
    if key in first.plan and key in case.plan:
        difference = float(str(case.plan[key])) - float(str(first.plan[key]))
        change = f"{abs(difference) / 60:.1f} min {'more' if difference > 0 else 'less'}"
        takes = "as long as" if abs(difference) < SAME_S else f"{change} than"
        yield f"The whole day, repositioning included, takes {takes} the scenario's."
    if against.track is not None:
        yield f"Legs included, the day has {_ratio(against.track)} times the information of the scenario's day."


def whatif_json(content: WhatIfContent) -> str:
    """`whatif.json`."""
    sentences = dict(explanations(content))
    described = {
        "scenario": content.cases[0].name,
        "cases": [_entry(content, case, sentences.get(case.name, ())) for case in content.cases],
    }
    return strict_json(described)


def _entry(content: WhatIfContent, case: Case, sentences: tuple[str, ...]) -> dict[str, object]:
    if case.problem:
        return {"name": case.name, "changes": list(case.changes), "problem": case.problem}
    against = content.against(case)
    return {
        "name": case.name,
        "changes": list(case.changes),
        "problem": None,
        **entry(case, "criterion", "runs", "informative_s", "gap_relative"),
        "efficiency": dict(case.efficiencies),
        "std": dict(zip(case.parameters, case.std.tolist(), strict=True)),
        "accuracy": None if against is None else against.accuracy,
        "same_accuracy_s": None if against is None else against.same_accuracy_s,
        "track_accuracy": None if against is None else against.track,
        "accuracy_by_time": [{"informative_s": time_s, "std_ratio": ratio} for time_s, ratio in content.curve(case)],
        "std_ratio": None if against is None else dict(zip(against.common, against.ratios, strict=True)),
        "plan": dict(case.plan) or None,
        "differences": list(sentences),
    }
