"""Results of load plans: JSON, load cases as files, and a document."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from expdesign import __version__
from expdesign.export.document import Document, Listing, Table, section
from expdesign.export.files import entry, finite, strict_json, toml_comments, toml_table
from expdesign.export.words import counted, ship
from expdesign.loading import LoadOption, LoadPlan
from expdesign.roll import MEANINGS, UNITS

HARDLY = 0.5  # relative standard deviation from which a parameter is said to be hardly determined


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadContent:
    """The values that page and files show."""

    scenario: str  # its name
    plan: LoadPlan  # the load cases
    known: Mapping[str, float]  # parameters that are not sought, by name
    commands: tuple[str, ...]  # that plan each load case, and estimate from the data
    command: str  # to reproduce it

    @property
    def options(self) -> tuple[LoadOption, ...]:
        """Load cases in the plan's order."""
        return tuple(self.plan.question.options[place] for place in self.plan.chosen.options)

    def runs(self, case: int) -> dict[str, int]:
        """Manoeuvre -> whole runs of a load case, those that are run."""
        repeats = self.plan.repeats[case].astype(int).tolist()
        return {name: count for name, count in zip(self.plan.manoeuvres, repeats, strict=True) if count}

    def time_s(self, case: int) -> float:
        """Informative time of a load case [s]."""
        return sum(count * self.plan.manoeuvres[name] for name, count in self.runs(case).items())


def case_table(content: LoadContent) -> Table:
    """A row for each load case."""
    rows: list[tuple[str, ...]] = []
    for case, option in enumerate(content.options):
        runs = content.runs(case)
        each = ", ".join(f"{name} {count}x" if count > 1 else name for name, count in runs.items())
        rows.append((str(case + 1), option.name, str(sum(runs.values())), each, f"{content.time_s(case):.0f}"))
    return Table(header=("Case", "Load", "Runs", "Manoeuvres", "Time [s]"), rows=rows, texts=4)


def precision_table(content: LoadContent) -> Table:
    """A row for each parameter that is sought."""
    plan = content.plan
    values = plan.question.theta[plan.question.places]
    rows = [
        (
            name, MEANINGS[name], f"{value:.4g}", f"{before:.2g}" if math.isfinite(before) else "unknown",
            f"{after:.2g}", UNITS[name],
        )
        for name, value, before, after in zip(
            plan.question.free, values, plan.std_before, plan.std_after, strict=True
        )
    ]  # fmt: skip
    header = ("Parameter", "Meaning", "Value", "Std before", "Std after, at least", "Unit")
    return Table(header=header, rows=rows, texts=2)


def step_table(content: LoadContent) -> Table:
    """A row for each number of load cases, the plan's marked."""
    plan = content.plan
    rows = [
        (
            f"{len(step.options)}, chosen" if step is plan.chosen else str(len(step.options)),
            "; ".join(plan.question.options[place].name for place in step.options),
            f"{step.efficiency:.3f}", f"{step.smallest:.2g}",
        )
        for step in plan.steps
    ]  # fmt: skip
    return Table(header=("Load cases", "Loads", "Efficiency", "Smallest relative sensitivity"), rows=rows, texts=2)


def load_sentences(content: LoadContent) -> Iterator[str]:
    """The findings."""
    plan = content.plan
    count, total = len(content.options), sum(content.time_s(case) for case in range(len(content.options)))
    yield (
        f"{counted(count, 'load case')} with {counted(int(plan.repeats.sum()), 'run')} in {total:.0f} s tell most "
        f"about {', '.join(plan.question.free)}: {'; '.join(option.name for option in content.options)}."
    )
    if len(plan.steps) > 1:
        yield (
            f"With these loads the best plan has an efficiency of {plan.chosen.efficiency:.3f} of the best with all "
            f"{len(plan.question.options)} candidates; whole runs keep {plan.design.efficiency_repeats:.3f} of that."
        )
    aim = plan.design.problem.aim
    yield (
        f"Best means here: the least volume of the confidence region of {', '.join(aim.interest) or 'all parameters'}. "
        f"No other shares of time on these loads and manoeuvres are better by more than {plan.design.gap:.1e} in "
        f"the logarithm of its determinant ({plan.design.certificate.kind})."
    )
    if plan.faintest.size > 0:
        yield (
            f"Least determined is a change of all of these together: {plan.faintest}. The relative standard "
            f"deviation along it is {1.0 / plan.faintest.size:.2g}."
        )
    values = np.abs(plan.question.theta[plan.question.places])
    hardly = [name for name, far in zip(plan.question.free, plan.std_after > HARDLY * values, strict=True) if far]
    if hardly:
        yield f"Hardly determined, with a standard deviation of half the value or more: {', '.join(hardly)}."
    if content.known:
        yield f"Not sought, as [known] gives them: {', '.join(content.known)}."
    if plan.design.note:
        yield plan.design.note


def load_plan_json(content: LoadContent) -> str:
    """All results as JSON."""
    plan = content.plan
    stds = zip(plan.question.free, plan.std_before.tolist(), plan.std_after.tolist(), strict=True)
    return strict_json(
        {
            "command": content.command,
            "version": __version__,
            "load_cases": [
                {
                    "name": option.name,
                    "unknown": option.load is None,
                    **({} if option.load is None else {
                        **entry(option.load, "mass_kg", "inertia_kgm2"), "height_m": -option.load.z_m,
                    }),
                    "runs": content.runs(case),
                    "time_s": content.time_s(case),
                }
                for case, option in enumerate(content.options)
            ],
            "parameters": {
                name: {"std_before": finite(before), "std_after_at_least": after, "unit": UNITS[name]}
                for name, before, after in stds
            },
            "steps": [
                {
                    "loads": [plan.question.options[place].name for place in step.options],
                    "efficiency": step.efficiency,
                    "smallest_relative_sensitivity": float(step.smallest),
                    "chosen": step is plan.chosen,
                }
                for step in plan.steps
            ],
            "told_worst": {"change": plan.faintest.change, "relative_std": finite(1.0 / plan.faintest.size)},
            "gap": plan.design.gap,
            "efficiency_whole_runs": plan.design.efficiency_repeats,
            "remarks": list(load_sentences(content)),
        }
    )  # fmt: skip


def repeats_json(content: LoadContent, case: int) -> str:
    """Whole runs of a load case, as `expdesign plan --durations` reads them."""
    counts = content.runs(case)
    return strict_json(
        {"primitives": [{"name": name, "repeats": counts.get(name, 0)} for name in content.plan.manoeuvres]}
    )


def loads_toml(content: LoadContent) -> str:
    """The load cases as `expdesign roll --loads` reads them, with --vessel."""
    lines = toml_comments(["Load cases of a roll trial, by:", f"    {content.command}"])
    for case, option in enumerate(content.options):
        lines += ["", *toml_comments([f"{case + 1}: {option.name}"]), "[[load]]"]
        if option.load is None:
            lines.append("unknown = true")
        elif option.load.mass_kg:
            stated = {"mass_kg": option.load.mass_kg, "height_m": -option.load.z_m}
            lines += toml_table("", {**stated, "inertia_kgm2": option.load.inertia_kgm2 or None})
    question = content.plan.question
    guessed = {name: float(question.theta[place]) for name, place in zip(question.free, question.places, strict=True)}
    start: Mapping[str, float] = {name: guessed[name] for name in ("m", "z_m") if name in guessed}
    for head, values in (("known", content.known), ("start", start)):
        if values:
            lines += ["", *toml_table(f"[{head}]", values)]
    return "\n".join(lines) + "\n"


def load_document(content: LoadContent) -> Document:
    """The plan for people."""
    plan, vessel = content.plan, content.plan.question.vessel
    waves = (
        "the waves of [roll.waves], met on all courses alike"
        if vessel.pendulum is not None and vessel.pendulum.waves
        else "no waves, as the vessel file has no [roll.waves]"
    )
    return Document(
        kind="Roll trial: loads and manoeuvres",
        title=content.scenario,
        name="Loads and manoeuvres of a roll trial",
        about=f"{ship(vessel)}. Known loads change how she rolls; from the change follow her inertia, damping, "
        "righting moment and the weight of an unknown load.",
        findings=tuple(load_sentences(content)),
        facts={
            "runs": int(plan.repeats.sum()),
            "efficiency": plan.chosen.efficiency,
            "smallest_relative_sensitivity": float(f"{plan.chosen.smallest:.2g}"),
        },
        values={
            "scenario": content.scenario,
            "load_cases": [option.name for option in content.options],
            "gap": plan.design.gap,
        },
        sections=(
            section(
                "Load cases, in this order",
                case_table(content),
                "Heights are above the origin of the vessel file\u2019s heights. Every run begins upright, on a "
                "steady straight course.",
            ),
            section("Each load case is planned on the chart by itself", Listing(content.commands)),
            section(
                "What the trial will tell",
                precision_table(content),
                "Standard deviations before the trial are those of the vessel file. Those after it are lower "
                f"bounds: they count the noise of the sensors and {waves}, but not what the model of roll "
                "misses, and an estimate by instruments reaches them only in part.",
            ),
            section(
                "How many load cases",
                step_table(content),
                "A plan with an efficiency of 0.9 needs 1/0.9 of the time for the information of the best plan "
                "with all loads. The relative sensitivity is that of the equations along the combination of "
                "parameters that they determine least. At 0.01 a coefficient changes by 1 % while the "
                "parameters change by 100 %.",
            ),
        ),
        command=content.command,
    )
