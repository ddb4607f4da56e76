"""The result of a trial on one page, for owner and class: what was done, what was promised, and what was measured."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import scipy
from pydantic import Field

from expdesign.assessment.misfit import ESTIMATION
from expdesign.conventions import OUTPUTS, plus_minus
from expdesign.export import words
from expdesign.export.document import Document, Mark, Table, filled, section
from expdesign.export.files.text import Entry
from expdesign.export.indices_form import shown

FEW = 0.9  # share of the time of the planned runs below which the data do not hold all of them
CHANCE = 0.05  # probability that any parameter is said to differ from the vessel file where none does
SIGNED_BY = ("Trial master", "Owner", "Class")
SPACES = tuple("_" * letters for letters in (30, 14, 30))  # for name, date and signature
MOTIONS = dict(zip(OUTPUTS, ("surge", "sway", "yaw rate"), strict=True))

# Entries of plan.json, of estimate.json and of indices.json.


class Expected(Entry):
    """A parameter in plan.json, in its own unit."""

    nominal: float
    std_before: float | None = None
    std_after_runs: float | None = None
    std_after: float | None = None
    std_asked: float | None = None


class PlannedLeg(Entry):
    """A leg of the plan."""

    class Moment(Entry):
        """The part of a state that is needed."""

        time_s: float

    kind: str
    name: str
    start: Moment
    end: Moment

    @property
    def time_s(self) -> float:
        """How long it takes."""
        return self.end.time_s - self.start.time_s


class PlanResult(Entry):
    """A plan, and the accuracy that it promises."""

    class Ship(Entry):
        """Whose trial it is."""

        name: str

    scenario: str
    vessel: Ship
    legs: list[PlannedLeg] = Field(min_length=1)
    parameters: dict[str, Expected] = Field(min_length=1)
    draft: bool = False

    @property
    def runs(self) -> list[PlannedLeg]:
        """Its runs in time order."""
        return [leg for leg in self.legs if leg.kind == "primitive"]

    @property
    def runs_s(self) -> float:
        """How long all of them take."""
        return sum(leg.time_s for leg in self.runs)


class Valued(Entry):
    """An estimated parameter."""

    value: float
    std: float | None


class Recorded(Entry):
    """A measured run."""

    name: str
    use: str
    samples: int


class RecordedRuns(Entry):
    """All of them."""

    runs: list[Recorded] = Field(min_length=1)
    doubts: list[str] = Field(default_factory=list)


class Estimated(Entry):
    """One method's estimate."""

    title: str
    in_vessel_file: bool
    parameters: dict[str, Valued]
    predictions: dict[str, dict[str, float | None]]
    sample_time_s: float
    data: RecordedRuns
    unstated: list[str] = Field(default_factory=list)


class Judged(Entry):
    """An index beside its criterion."""

    source: str
    run: str
    side: str
    index: str
    name: str = ""
    value: float | None
    tolerance: float
    limit: float
    rule: str
    met: bool | None


class Indices(Entry):
    """All of them."""

    vessel: str
    applies: str
    verdicts: list[Judged]


@dataclass(frozen=True, kw_only=True)
class ResultContent:
    """The values that the page shows."""

    plan: PlanResult
    estimate: Estimated  # the one in the vessel file
    indices: Indices | None  # None where none were computed

    @property
    def recorded_s(self) -> float:
        """Length of all records."""
        return sum(run.samples for run in self.estimate.data.runs) * self.estimate.sample_time_s

    @property
    def used_s(self) -> float:
        """Length of those that are estimated from."""
        used = [run.samples for run in self.estimate.data.runs if run.use == ESTIMATION]
        return sum(used) * self.estimate.sample_time_s


def result_document(content: ResultContent) -> Document:
    """Verdict, findings and tables."""
    asked, measured = _met(content), _measured(content.indices)
    unmet = [name for name, met in asked.items() if not met]
    text = f"{'not all ' if unmet else ''}as accurate as asked" if asked else "measured"
    return Document(
        kind="Trial result",
        title=content.plan.vessel.name,
        about=f"Trial {content.plan.scenario}, estimated by {content.estimate.title}",
        mark=Mark(text=text, good=not unmet if asked else None),
        findings=tuple(
            line
            for line in (
                _accuracy(content),
                _changed(content),
                _predicted(content.estimate),
                _criteria(measured),
            )
            if line
        ),
        facts={
            "planned_s": content.plan.legs[-1].end.time_s,
            "recorded_s": content.recorded_s,
            "runs_planned": len(content.plan.runs),
            "runs_recorded": len(content.estimate.data.runs),
        },
        values={"parameters": {name: _entry(content, name) for name in content.plan.parameters}},
        sections=filled(
            section("What was done", Table(header=("Run", "Planned", "Recorded", "Use"), rows=run_rows(content))),
            section(
                "Indices and their limits by MSC.137(76)",
                Table(
                    header=("Run", "Index", "Measured", "Model", "Limit", "Verdict"),
                    rows=index_rows(content.indices),
                    texts=2,
                ),
                content.indices.applies if content.indices else "",
            ),
            section(
                "Signatures",
                Table(header=("", "Name", "Date", "Signature"), rows=[(who, *SPACES) for who in SIGNED_BY],
                      texts=4, on="page"),
            ),
            section(
                "Parameters",
                Table(
                    header=("Parameter", "Before", "Estimate", "Planned", *(("Asked", "Verdict") if asked else ())),
                    rows=[parameter_row(content, name)[: 6 if asked else 4] for name in content.plan.parameters],
                ),
                "Before is the vessel file that the trial was planned with. Planned is the standard deviation that the "
                f"plan promises of {'the whole track' if _whole(content) else 'the runs alone'}"
                f"{', asked the largest that the scenario allows' if asked else ''}. Parameters are in m, s and rad, "
                "and the model's units of force.",
            ),
        ),
        notes=(*_left_out(content), *_in_doubt(content.estimate)),
    )  # fmt: skip


def _met(content: ResultContent) -> dict[str, bool]:
    """Parameter whose accuracy is asked for -> whether its estimate is as accurate."""
    asked = {name: one.std_asked for name, one in content.plan.parameters.items() if one.std_asked is not None}
    found = {name: one.std for name, one in content.estimate.parameters.items() if one.std is not None}
    return {name: name in found and found[name] <= most for name, most in asked.items()}


def _whole(content: ResultContent) -> bool:
    """Whether the data hold the legs between the runs, too: they last longer than half way from runs to whole track."""
    return content.used_s > (content.plan.runs_s + content.plan.legs[-1].end.time_s) / 2


def _planned(content: ResultContent) -> dict[str, float]:
    """Standard deviations that the plan promises of what the data hold."""
    of_all = {
        name: one.std_after if _whole(content) else one.std_after_runs for name, one in content.plan.parameters.items()
    }
    return {name: value for name, value in of_all.items() if value is not None}


def _accuracy(content: ResultContent) -> str:
    """What was asked for, or else what was promised, beside what came out."""
    met = _met(content)
    if met and all(met.values()):
        return f"Every accuracy that was asked for is reached, of {words.counted(len(met), 'parameter')}."
    if met:
        short = ", ".join(name for name, reached in met.items() if not reached)
        return f"{words.counted(sum(met.values()), 'parameter')} of {len(met)} as accurate as asked; not {short}."
    found = {name: one.std for name, one in content.estimate.parameters.items() if one.std is not None}
    ratios = [found[name] / planned for name, planned in _planned(content).items() if name in found]
    if not ratios:
        return ""
    least, middle, most = (words.significant(value, 2) for value in (min(ratios), median(ratios), max(ratios)))
    return (
        f"Standard deviations of the estimates are {middle} times those planned (median; {least} to {most}). "
        "The scenario limits none of them."
    )


def _left_out(content: ResultContent) -> tuple[str, ...]:
    """What runs that are not in the data, or else the legs between them, would tell."""
    pairs = [(one.std_after_runs, one.std_after) for one in content.plan.parameters.values()]
    gains = [runs / track for runs, track in pairs if runs and track]
    if content.used_s < FEW * content.plan.runs_s:
        return (
            f"The estimate is from {words.duration(content.used_s)} of data, the planned standard deviations are those "
            f"of all runs, {words.duration(content.plan.runs_s)}.",
        )
    if _whole(content) or not gains:
        return ()
    return (
        "The data hold the runs alone. By the plan, an estimate from the whole record, with the legs between them, is "
        f"{words.significant(median(gains), 2)} times as accurate (median).",
    )


def _in_doubt(estimate: Estimated) -> tuple[str, ...]:
    """What puts the estimate into question: what nobody stated, and what the data's instruments disagree about."""
    return (*estimate.unstated, *estimate.data.doubts)


def _changed(content: ResultContent) -> str:
    """Parameters that the trial has shown to be others than the vessel file says, by Bonferroni."""
    off = {name: value for name in content.plan.parameters if (value := _deviations(content, name)) is not None}
    if not off:
        return ""
    limit = -float(scipy.special.ndtri(CHANCE / (2 * len(off))))
    far = sorted((name for name, value in off.items() if abs(value) > limit), key=lambda name: -abs(off[name]))
    if not far:
        return "No parameter differs from the vessel file by more than both uncertainties explain."
    told = "; ".join(
        f"{name} is {plus_minus(found.value, found.std or math.nan)}, the file says "
        f"{plus_minus(before.nominal, before.std_before or math.nan)}"
        for name, found, before in ((n, content.estimate.parameters[n], content.plan.parameters[n]) for n in far[:3])
    )
    more = f"; {len(far) - 3} more" if len(far) > 3 else ""
    where = (
        "What notes say of current, times of orders or instruments may be why" if _in_doubt(content.estimate) else ""
    )
    seems = "seems not to be" if where else "is not"
    return f"The ship {seems} as her file said: {told}{more}.{f' {where}.' if where else ''}"


def _deviations(content: ResultContent, name: str) -> float | None:
    """An estimate's distance to the vessel file's value in standard deviations of both; None where one is unknown."""
    before, found = content.plan.parameters[name], content.estimate.parameters.get(name)
    if found is None or found.std is None or before.std_before is None:
        return None
    return (found.value - before.nominal) / math.hypot(found.std, before.std_before)


def _predicted(estimate: Estimated) -> str:
    """Errors of the best method's predictions of what it has not seen."""
    tried = [one for one in estimate.predictions.values() if one.get("unseen") and one.get("together") is not None]
    if not tried:
        return ""
    best = min(tried, key=lambda one: one["together"] or math.inf)
    errors = [f"{words.percent(share)} in {MOTIONS[key]}" for key, share in best.items() if key in MOTIONS and share]
    return f"Errors of its predictions of runs left out, 30 s ahead: {', '.join(errors)} of the standard deviation."


def _measured(indices: Indices | None) -> list[Judged]:
    return [] if indices is None else [one for one in indices.verdicts if one.source == "measured"]


def _criteria(measured: Sequence[Judged]) -> str:
    if not measured:
        return ""
    broken = [f"{one.name or one.index} in {one.run}" for one in measured if one.met is False]
    met = sum(one.met is True for one in measured)
    text = f"{met} of {len(measured)} measured indices within their limits"
    return f"{text}; not {', '.join(broken)}." if broken else f"{text}."


def run_rows(content: ResultContent) -> list[tuple[str, ...]]:
    """Planned runs beside the records that are named after them; the others follow."""
    step, left = content.estimate.sample_time_s, list(content.estimate.data.runs)
    rows = []
    for leg in content.plan.runs:
        found = next((run for run in left if _plain(run.name) == _plain(leg.name)), None)
        recorded, use = ("no record of that name", "") if found is None else (_time(found, step), found.use)
        if found is not None:
            left.remove(found)
        rows.append((leg.name, words.duration(leg.time_s), recorded, use))
    return [*rows, *((run.name, "", _time(run, step), run.use) for run in left)]


def _time(run: Recorded, step_s: float) -> str:
    return words.duration(run.samples * step_s)


def _plain(name: str) -> str:
    """Letters and digits of a run's name, without the number and the ending of its file."""
    return re.sub(r"^\d+-|\.csv$|[\W_]", "", name.lower())


def parameter_row(content: ResultContent, name: str) -> tuple[str, ...]:
    """Parameter, value before, estimate, standard deviations planned and asked for, verdict."""
    before, found = content.plan.parameters[name], content.estimate.parameters.get(name)
    met, planned = _met(content).get(name), _planned(content).get(name)
    return (
        name,
        plus_minus(before.nominal, before.std_before or math.nan),
        "not estimated" if found is None else plus_minus(found.value, found.std or math.nan),
        *("" if value is None else words.significant(value, 2) for value in (planned, before.std_asked)),
        "" if met is None else "met" if met else "NOT met",
    )


def _entry(content: ResultContent, name: str) -> Mapping[str, object]:
    """The same for JSON."""
    found = content.estimate.parameters.get(name)
    return {
        **content.plan.parameters[name].model_dump(),
        "estimate": None if found is None else found.value,
        "std": None if found is None else found.std,
        "met": _met(content).get(name),
    }


def index_rows(indices: Indices | None) -> list[tuple[str, ...]]:
    """Run, index, measured, that of the model to the same side, limit and verdict."""
    found = indices.verdicts if indices else []
    model = {(one.index, one.side): one.value for one in found if one.source != "measured"}
    return [
        (
            one.run,
            one.name or one.index,
            shown(one.index, one.value, one.tolerance),
            shown(one.index, model.get((one.index, one.side))) if (one.index, one.side) in model else "",
            shown(one.index, one.limit),
            {True: "met", False: "NOT met", None: "open" if one.value is not None else "no result"}[one.met],
        )
        for one in _measured(indices)
    ]
