"""What a designed trial of the model ship is worth: `published/design_value.py [--runs N] [--out F]`.

Trials of 1000 samples at 8 Hz of the true model ship, with white current and white errors of u, v, r, each of variance
0.025; instruments are simulated with the nominal model, complete mean taken off. Designs, from tau1 to tau11:

optimised       D-optimal shares by the nominal model, rounded to whole samples by largest remainders
source's        the shares that the source prints for its own primitives: 16, 4, 9, 42, 4 and 25 %
equal           the same for all eleven
random          five segments of 200 samples, the primitive of each drawn anew for every trial

A trial is one voyage: inputs follow one another, each primitive from its first command, in the dictionary's order or
the random one. A primitive with more samples than its one run of 300 begins again. Errors are root mean squares over
the ten parameters of (estimate - truth) / |truth|.

The unseen input is a multisine of 125 s, a family that no design uses: u 0.6 +- 0.4 m/s, |v| up to 0.15 m/s, |r| up to
0.35 rad/s by the nominal ship, about the middle of what the primitives reach. True ship and estimated models are
simulated with it without noise, from the same velocity.

What the source leaves open is varied in a second table: whether runs are sailed separately, each from its own entry
velocity with some rows of it taken, and which ship has the velocity ranges it gives for the primitives. Ours are the
nominal ship's, which a designer knows; the true ship's thrust is stronger and its damping less, so it moves faster.

Found with 500 trials: the optimised design has the published accuracy (errors below 1.5 in 100 %, of simulations below
0.15 in 99.6 %; published more than 99 % and 99 %), random designs are better than published (84 and 80 %; 46 and
69 %). With slower primitives, whose ranges the true ship has, random designs come down to 58 and 68 %, but the
optimised one to 83 and 88 %, too. So all numbers hang on the size of the signals beside the noise, and no choice tried
here gives both published ones; `design_readings.py` varies how random designs are sailed and estimated from. The
period of the zig-zags, not given either, does not decide: with half and with three times of ours random designs have
85 %. Most of the error is that of Y_ur, whose true value is small, then of N_uv and X_|u|u. Equal shares come close to
the optimised ones here; their errors of the parameters are large in 2 % of the trials.

Source: F. Ljungberg, doctoral thesis, Linköping University, 9.1.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress as Bar

sys.path.insert(0, str(Path(__file__).parents[1]))
from adaptive import SCENARIOS
from adaptive_monte_carlo import Segment, drawn, separate_runs, shared_out, voyages
from design_value_page import DesignErrors, StudyTable, design_value_html
from expdesign.dictionary import Primitive, PrimitiveSpec, build_dictionary, build_primitive
from expdesign.export.folder import write_files
from expdesign.growing import optimum
from expdesign.information import score_primitives
from expdesign.processes import in_order
from expdesign.scenario import load_dictionary, load_vessel
from expdesign.simulation import CALM, simulate_ensemble
from expdesign.values import Array
from expdesign.vessel import Sensors, Vessel
from shared_work import add_sharing, shared_work

Progress = Callable[[str, float], None]
ERROR_LIMIT, NORM_LIMIT = 1.5, 0.15
OPTIMISED, SOURCE, EQUAL, RANDOM = "optimised", "source's shares", "equal shares", "random"
DESIGNS = (OPTIMISED, SOURCE, EQUAL, RANDOM)
SEGMENTS = 5  # of a random design
SOURCE_SHARES = {1: 0.16, 2: 0.04, 5: 0.09, 6: 0.42, 8: 0.04, 11: 0.25}  # number of the primitive -> share (9.1.1)
PUBLISHED = {OPTIMISED: (0.99, 0.99), RANDOM: (0.46, 0.69)}
"""Design -> share of trials below ERROR_LIMIT (more than 0.99 for the first), and below NORM_LIMIT (9.1.2)."""
UNSEEN = PrimitiveSpec(
    name="unseen",
    family="multisine",
    settings={
        "duration_s": 125.0,
        "period_s": 62.5,
        "speed_mps": 0.6,
        "speed_swing_mps": 0.4,
        "sway_mps": 0.15,
        "yaw_rate_radps": 0.35,
    },
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """How trials are made.

    Attributes:
        name: for tables.
        truth, nominal: the ships.
        primitives: tau1 to tau11.
        optimal: (11,) D-optimal shares.
        joined: whether a trial is one voyage.
    """

    name: str
    truth: Vessel
    nominal: Vessel
    primitives: tuple[Primitive, ...]
    optimal: Array
    joined: bool = True

    def shares(self, design: str) -> Array:
        """(11,) shares of the time, of a design that has them."""
        if design == OPTIMISED:
            return self.optimal
        count = len(self.primitives)
        if design == EQUAL:
            return np.full(count, 1.0 / count)
        return np.array([SOURCE_SHARES.get(number, 0.0) for number in range(1, count + 1)])


def cases() -> tuple[Case, ...]:
    """The study itself, then what differs where the source leaves it open."""
    nominal, truth = (load_vessel(SCENARIOS / "vessels" / f"{name}.toml") for name in ("model-ship", "model-ship-true"))
    first = _case("one voyage, ranges by the nominal ship", truth, nominal, ranges=nominal)
    return (
        first,
        replace(first, name="separate runs, ranges by the nominal ship", joined=False),
        _case("one voyage, ranges by the true ship", truth, nominal, ranges=truth),
    )


def _case(name: str, truth: Vessel, nominal: Vessel, *, ranges: Vessel) -> Case:
    """Actuators of the published trials jump from command to command."""
    truth, nominal = _prompt(truth), _prompt(nominal)
    primitives = build_dictionary(ranges, load_dictionary(SCENARIOS / "dictionaries" / "model-ship.toml"))
    best = optimum(score_primitives(ranges, primitives), "complete")
    return Case(name=name, truth=truth, nominal=nominal, primitives=primitives, optimal=best.fractions)


def _prompt(ship: Vessel) -> Vessel:
    actuators = tuple(replace(actuator, responses=()) for actuator in ship.model.actuators)
    return replace(ship, model=replace(ship.model, actuators=actuators))


def try_design(case: Case, design: str, *, runs: int, seed: int = 0) -> DesignErrors:
    """Errors of `runs` simulated trials of a design; its random numbers are its own."""
    rng = np.random.default_rng([seed, DESIGNS.index(design)])
    make = voyages if case.joined else separate_runs
    trials = make(case.truth, case.nominal, case.primitives, _segments(case, design, runs, rng), rng=rng)
    return DesignErrors(
        name=design,
        parameters=trials.errors,
        outputs=simulation_errors(case.truth, case.nominal, trials.estimates),
        spread=np.nanmedian(np.abs(trials.estimates / trials.truth - 1.0), axis=0),
    )


def _segments(case: Case, design: str, runs: int, rng: np.random.Generator) -> tuple[Segment, ...]:
    if design == RANDOM:
        return drawn(case.primitives, segments=SEGMENTS, runs=runs, rng=rng)
    return shared_out(case.primitives, case.shares(design), runs=runs)


def simulation_errors(truth: Vessel, nominal: Vessel, estimates: Array) -> Array:
    """(n, 3) root mean square of u, v, r simulated with estimates (n, p) less the true ship's, on the unseen input.

    Models that diverge, and estimates that are missing, have infinite errors.
    """
    unseen = build_primitive(nominal, UNSEEN)
    commands = np.concatenate([unseen.commands.values, unseen.commands.values[-1:]])
    quiet = replace(truth, sensors=Sensors())
    everyone = np.concatenate([truth.model.parameters[None], estimates])
    sailed = simulate_ensemble(
        quiet,
        commands,
        runs=len(everyone),
        environment=CALM,
        rng=np.random.default_rng(0),
        velocity=unseen.entry_velocity,
        parameters=everyone,
    ).velocity
    with np.errstate(over="ignore", invalid="ignore"):
        errors = np.sqrt(((sailed[:, 1:] - sailed[:, :1]) ** 2).mean(axis=0))
    return np.asarray(np.where(np.isfinite(errors), errors, np.inf))


def main_table(found: Sequence[DesignErrors]) -> StudyTable:
    """Our numbers beside the published ones."""
    header = ("design", f"below {ERROR_LIMIT:g}", "published", "median")
    simulated = (f"simulated below {NORM_LIMIT:g}", "published", "median u [m/s]", "v [m/s]", "r [rad/s]")
    return StudyTable(
        title="Trials with small errors, ours and published",
        header=(*header, *simulated),
        rows=tuple(_main_row(item) for item in found),
        note="Shares of the trials, with binomial standard errors: of those with a small error of the parameters, then "
        "of those whose model simulates unseen input with a small norm of the root mean squares of u, v and r.",
    )


def _main_row(item: DesignErrors) -> tuple[str, ...]:
    published = PUBLISHED.get(item.name)
    more = "> " if item.name == OPTIMISED else ""
    return (
        item.name,
        _share(item.parameters < ERROR_LIMIT),
        "" if published is None else f"{more}{100 * published[0]:.0f} %",
        f"{np.median(item.parameters):.2f}",
        _share(item.norm < NORM_LIMIT),
        "" if published is None else f"{100 * published[1]:.0f} %",
        *(f"{value:.3f}" for value in np.median(item.outputs, axis=0)),
    )


def _share(good: NDArray[np.bool_]) -> str:
    """With its standard error, in which half a trial of either kind is added so that 0 and 100 % have one."""
    smoothed = (good.sum() + 0.5) / (len(good) + 1)
    return f"{100 * good.mean():.1f} ± {100 * (smoothed * (1 - smoothed) / len(good)) ** 0.5:.1f} %"


def parameter_table(case: Case, found: Sequence[DesignErrors]) -> StudyTable:
    """Which parameters decide."""
    columns = zip(case.truth.model.names, *(item.spread for item in found), strict=True)
    return StudyTable(
        title="Median error of each parameter, relative to its true value",
        header=("parameter", *(item.name for item in found)),
        rows=tuple((name, *(f"{value:.3f}" for value in values)) for name, *values in columns),
    )


def open_table(found: Mapping[str, Sequence[DesignErrors]]) -> StudyTable:
    """The same shares where what the source leaves open is chosen otherwise."""
    return StudyTable(
        title="How they hang on what the source leaves open",
        header=("trials", "design", f"below {ERROR_LIMIT:g}", f"simulated below {NORM_LIMIT:g}"),
        rows=tuple(
            (name, item.name, _share(item.parameters < ERROR_LIMIT), _share(item.norm < NORM_LIMIT))
            for name, designs in found.items()
            for item in designs
        ),
        text_columns=2,
    )


def shares_table(case: Case) -> StudyTable:
    """Optimised shares beside the source's."""
    rows = zip(case.primitives, case.optimal, case.shares(SOURCE), strict=True)
    return StudyTable(
        title="Shares of the time",
        header=("primitive", "ours", "published"),
        rows=tuple((item.name, f"{100 * ours:.1f} %", f"{100 * theirs:.0f} %") for item, ours, theirs in rows),
    )


def study(*, runs: int, seed: int, progress: Progress) -> Iterator[tuple[StudyTable, list[DesignErrors]]]:
    """Tables as soon as they are there, the second with the errors to draw."""
    found: dict[str, list[DesignErrors]] = {}
    progress("designing", 0.0)
    kinds = cases()
    yield shares_table(kinds[0]), []
    for place, case in enumerate(kinds):
        tried = in_order(partial(try_design, runs=runs, seed=seed), (case,), ((design,) for design in DESIGNS))
        for number, design in enumerate(DESIGNS):
            progress(f"{case.name}: {design}", (place + number / len(DESIGNS)) / len(kinds))
            found.setdefault(case.name, []).append(next(tried))
        if place == 0:
            yield main_table(found[case.name]), found[case.name]
            yield parameter_table(case, found[case.name]), []
    yield open_table(found), []


def study_json(found: Sequence[DesignErrors], tables: Sequence[StudyTable], *, runs: int, seed: int) -> str:
    """`design-value.json`: the tables, and the errors of every trial of the first case."""
    content = {
        "runs": runs,
        "seed": seed,
        "tables": [{"title": item.title, "header": item.header, "rows": item.rows} for item in tables],
        "errors": {
            item.name: {"parameters": _finite(item.parameters), "simulation_norm": _finite(item.norm)} for item in found
        },
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(values: Array) -> list[float | None]:
    """Six digits; null where there is no finite number."""
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables, write the page if wished; progress goes to stderr. Returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python tests/benchmarks/published/design_value.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--runs", type=int, default=500, help="simulated trials of each design (published: 500)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder for design-value.html and design-value.json")
    add_sharing(parser)
    chosen = parser.parse_args(arguments)
    if chosen.runs < 2:
        parser.error(f"--runs is {chosen.runs}, expected 2 or more")
    console = Console(highlight=False, markup=False, soft_wrap=True)
    tables: list[StudyTable] = []
    to_draw: list[DesignErrors] = []
    with shared_work(chosen), Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        try:
            for table, errors in study(
                runs=chosen.runs,
                seed=chosen.seed,
                progress=lambda what, share: bar.update(task, description=what, completed=share),
            ):
                tables.append(table)
                to_draw += errors
                console.print(_shown(table))
        except KeyboardInterrupt:
            bar.console.print("interrupted; the tables above are complete, no files were written")
            return 130
    if chosen.out:
        command = f"python tests/benchmarks/published/design_value.py --runs {chosen.runs} --seed {chosen.seed}"
        page = design_value_html(to_draw, tables, limits=(ERROR_LIMIT, NORM_LIMIT), command=command)
        data = study_json(to_draw, tables, runs=chosen.runs, seed=chosen.seed)
        for path in write_files(chosen.out, {"design-value.html": page, "design-value.json": data}):
            console.print(f"Written: {path}")
    return 0


def _shown(table: StudyTable) -> str:
    widths = [max(map(len, column)) for column in zip(table.header, *table.rows, strict=True)]
    lines = [
        "   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (table.header, *table.rows)
    ]
    return "\n".join([table.title, *lines, *([table.note] if table.note else []), ""])


if __name__ == "__main__":
    sys.exit(main())
