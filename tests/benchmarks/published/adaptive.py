"""What a grown dictionary is worth: `python tests/benchmarks/published/adaptive.py [--runs N] [--rounds N] [--seed N]`.

1. The model ship. The dictionary tau1 to tau11 is grown within the velocities that it spans itself: once by the
   families alone, once with commands optimised freely, and once by the families with no more force than tau1 to tau11
   use either. The optimal design of each is compared with the optimal design of tau1 to tau11: by the nominal
   model, and by the covariance of instrumental-variable estimates from simulated trials of the true ship.
2. The 30 m ship. How many minutes of informative time give the information of one set of standard trials (turning
   circles, zig-zags 10/10 and 20/20 and pull-outs to both sides, stopping), repositioning not counted.

Efficiencies are ratios of determinants to the power 1/p: how many times less time the same accuracy takes.

Source of ship, dictionary and noise: F. Ljungberg, doctoral thesis, Linköping University, chapter 9.1; of the trials:
IMO MSC.137(76).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console

from adaptive_monte_carlo import Trials, simulate_trials
from expdesign.dictionary import Primitive, build_dictionary
from expdesign.growing import GrowSettings, Growth, grow_dictionary, optimum, shared
from expdesign.information import PrimitiveInformation, score_primitives
from expdesign.scenario import load_dictionary, load_vessel
from expdesign.simulation import Conduct, Environment, pull_out, steady_ahead, stopping, turning_circle, zigzag
from expdesign.vessel import Vessel

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
WIND = Environment(wind_to=np.array([3.0, 2.0]))
"""As in scenarios/helsinki.toml: without wind its parameters cannot be estimated."""
RUN_S = 120.0  # length of runs added to the standard trials
BOOTSTRAPS = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """A dictionary grown from tau1 to tau11, and what it is worth.

    Attributes:
        name: how it was grown.
        growth: the dictionary.
        nominal: efficiency relative to the optimal design of tau1 to tau11, by the nominal model.
        base, grown: estimates from simulated trials of both designs.
    """

    name: str
    growth: Growth
    nominal: float
    base: Trials
    grown: Trials

    @property
    def measured(self) -> float:
        """The same efficiency by the covariances of the estimates, without the wildest 5 % of either."""
        return central_efficiency(self.base, self.grown)

    @property
    def measured_error(self) -> float:
        """Its standard error, by drawing the trials again."""
        rng = np.random.default_rng(0)
        draws = [central_efficiency(_redrawn(self.base, rng), _redrawn(self.grown, rng)) for _ in range(BOOTSTRAPS)]
        return float(np.std(draws, ddof=1))

    @property
    def measured_all(self) -> float:
        """The same with all estimates, of which a few decide."""
        return float(np.exp((self.base.log_det - self.grown.log_det) / len(self.base.truth)))


def central_efficiency(base: Trials, other: Trials) -> float:
    """Ratio of the determinants of two covariances to the power 1/p, without the wildest 5 % of either."""
    return float(np.exp((base.central_log_det - other.central_log_det) / len(base.truth)))


def _redrawn(trials: Trials, rng: np.random.Generator) -> Trials:
    count = len(trials.estimates)
    return replace(trials, estimates=trials.estimates[rng.integers(0, count, size=count)])


def model_ship(name: str = "model-ship") -> tuple[Vessel, tuple[PrimitiveInformation, ...]]:
    """The nominal model ship and tau1 to tau11, scored."""
    ship = load_vessel(SCENARIOS / "vessels" / f"{name}.toml")
    primitives = build_dictionary(ship, load_dictionary(SCENARIOS / "dictionaries" / "model-ship.toml"))
    return ship, score_primitives(ship, primitives)


def same_forces(ship: Vessel, primitives: Sequence[Primitive]) -> Vessel:
    """The ship with no more force than these primitives use."""
    used = np.concatenate([primitive.commands.values for primitive in primitives])
    (actuator,) = ship.actuators
    limits = tuple(
        replace(limit, low=float(low), high=float(high))
        for limit, low, high in zip(actuator.limits, used.min(axis=0), used.max(axis=0), strict=True)
    )
    return replace(ship, model=replace(ship.model, actuators=(replace(actuator, limits=limits),)))


def compare(
    name: str, settings: GrowSettings, *, runs: int, seed: int = 0, narrow: bool = False, samples: int = 1000
) -> Comparison:
    """Grow tau1 to tau11 and try both optimal designs on the true ship."""
    ship, information = model_ship()
    truth = load_vessel(SCENARIOS / "vessels" / "model-ship-true.toml")
    searched = same_forces(ship, [item.primitive for item in information]) if narrow else ship
    growth = grow_dictionary(searched, information, settings=settings)
    first, last = (optimum(items, "complete") for items in (information, growth.information))
    base, grown = (
        simulate_trials(
            truth,
            ship,
            [item.primitive for item in items],
            best.fractions,
            runs=runs,
            rng=np.random.default_rng([seed, stage]),
            samples=samples,
        )
        for stage, (items, best) in enumerate(((information, first), (growth.information, last)))
    )
    efficiency = float(np.exp((last.log_det - first.log_det) / growth.parameters))
    return Comparison(name=name, growth=growth, nominal=efficiency, base=base, grown=grown)


def standard_trials(ship: Vessel) -> tuple[Primitive, ...]:
    """Turning circles, zig-zags 10/10 and 20/20 and pull-outs to both sides, and stopping, at service speed."""
    entry, ten, twenty = steady_ahead(ship).inputs, np.radians(10.0), np.radians(20.0)
    trials = {}
    for side in ("starboard", "port"):
        trials[f"turning circle {side}"] = turning_circle(ship, side=side)
        trials[f"zig-zag 10/10 {side}"] = zigzag(ship, heading_rad=ten, helm_rad=ten, side=side)
        trials[f"zig-zag 20/20 {side}"] = zigzag(ship, heading_rad=twenty, helm_rad=twenty, side=side)
        trials[f"pull-out {side}"] = pull_out(ship, side=side)
    trials["stopping"] = stopping(ship, conduct=Conduct())
    return tuple(
        Primitive(
            name=name, family="standard trial", settings={}, commands=commands, entry_inputs=entry, trajectory=run
        )
        for name, (commands, run) in trials.items()
    )


@dataclass(frozen=True, kw_only=True)
class Minutes:
    """Informative time, a rate rather than a trial: single runs last longer than some of these.

    Attributes:
        name: of the design.
        same: gives the determinant of the information of one set of standard trials.
        no_worse: leaves no parameter of hull and thrusters with a larger predicted variance than the set does.
        wind: the same for the wind's parameters, which hardly any manoeuvre tells sooner: headings against the wind do.
    """

    name: str
    same: float
    no_worse: float
    wind: float


def minutes_for_the_same(options: GrowSettings) -> tuple[tuple[Minutes, ...], dict[str, Growth]]:
    """The 30 m ship's standard trials against designed ones, in wind, for all parameters of its model.

    First the set itself, then its trials with the time shared out optimally, the optimal design of the ship's
    dictionary, and those of the trials grown within their own velocities, without and with free form.
    """
    ship = load_vessel(SCENARIOS / "vessels" / "azimuth-30m.toml")
    trials = score_primitives(ship, standard_trials(ship), environment=WIND)
    length_s = np.array([item.primitive.duration_s for item in trials])
    once, whole = shared(trials, length_s / length_s.sum()), float(length_s.sum()) / 60
    p = len(ship.model.names)
    wind = np.array([name.startswith("W_") for name in ship.model.names])

    def needed(name: str, information: Sequence[PrimitiveInformation]) -> Minutes:
        best = optimum(information, "complete")
        variance = np.diag(best.inverse)[:p] / np.diag(once.inverse)[:p]
        same = whole * float(np.exp((once.log_det - best.log_det) / p))
        hull, air = whole * float(variance[~wind].max()), whole * float(variance[wind].max())
        return Minutes(name=name, same=same, no_worse=hull, wind=air)

    growths = {
        name: grow_dictionary(ship, trials, settings=replace(options, free_form=free, run_s=RUN_S), environment=WIND)
        for name, free in (("families", False), ("free form", True))
    }
    specs = load_dictionary(SCENARIOS / "dictionaries" / "standard.toml")
    own = score_primitives(ship, build_dictionary(ship, specs), environment=WIND)
    rows = (
        Minutes(name="set", same=whole, no_worse=whole, wind=whole),
        needed("shared out", trials),
        needed("dictionary", own),
        needed("grown", growths["families"].information),
        needed("free form", growths["free form"].information),
    )
    return rows, growths


def growth_table(growth: Growth) -> str:
    """What was added, and what each addition brought."""
    lines = [f"{'round':>5}  {'family':<20} {'d before':>9} {'log det':>8} {'efficiency':>10}  settings"]
    for number, row in enumerate(growth.rounds, start=1):
        settings = " ".join(f"{key}={value:.4g}" for key, value in row.settings.items() if key != "duration_s")
        lines.append(
            f"{number:>5}  {row.family:<20} {row.sensitivity:>9.2f} {row.log_det_gain:>+8.3f} {row.efficiency:>10.3f}  "
            f"{settings}"
        )
    lines.append(
        f"dimension {growth.dimension}; {growth.evaluated} candidates looked at; best left {growth.best_left:.3f}, so "
        f"at least {100 * growth.efficiency_left:.1f} % of what those candidates allow"
    )
    return "\n".join(lines)


def comparison_table(found: Sequence[Comparison], names: Sequence[str]) -> str:
    """Efficiencies, and the spread of every parameter's estimate relative to its true value."""
    lines = [f"{'grown by':<24} {'nominal':>8} {'trials':>14} {'all of them':>12} {'time for the same':>18}"]
    for item in found:
        trials = f"{item.measured:.2f} +- {item.measured_error:.2f}"
        lines.append(
            f"{item.name:<24} {item.nominal:>8.2f} {trials:>14} {item.measured_all:>12.2f} "
            f"{100 / item.measured:>16.0f} %"
        )
    base, truth = found[0].base, np.abs(found[0].base.truth)
    lines += ["", "trials: without the wildest 5 % of the estimates of either design, which decide the next column"]
    lines += ["std / |true|, in brackets how many times smaller: std, half of the middle 68 %"]
    lines += [f"{'':<12}{'tau1-tau11':>12}" + "".join(f"{item.name:>26}" for item in found)]
    for place, name in enumerate(names):
        cells = []
        for item in found:
            ratios = (
                item.base.std[place] / item.grown.std[place],
                item.base.half_width[place] / item.grown.half_width[place],
            )
            cells.append(f"{item.grown.std[place] / truth[place]:.3f} ({ratios[0]:.2f}, {ratios[1]:.2f})")
        lines.append(f"{name:<12}{base.std[place] / truth[place]:>12.3f}" + "".join(f"{cell:>26}" for cell in cells))
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both parts."""
    parser = argparse.ArgumentParser(prog="python tests/benchmarks/published/adaptive.py", description=__doc__)
    parser.add_argument("--runs", type=int, default=800, help="simulated trials of each design")
    parser.add_argument("--rounds", type=int, default=12, help="most additions")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pool", type=int, default=256, help="candidates of every family to begin with")
    parser.add_argument("--part", choices=("ship", "trials", "both"), default="both")
    chosen = parser.parse_args(arguments)
    console = Console(highlight=False, markup=False, soft_wrap=True)
    options = GrowSettings(rounds=chosen.rounds, pool=chosen.pool, seed=chosen.seed)
    if chosen.part != "trials":
        console.print(_ship_part(options, chosen.runs))
    if chosen.part != "ship":
        console.print(_trials_part(options))


def _ship_part(options: GrowSettings, runs: int) -> str:
    cases = (
        ("families", options, False),
        ("families + free form", replace(options, free_form=True), False),
        ("families, same forces", options, True),
    )
    found = [
        compare(name, settings, runs=runs, seed=options.seed or 0, narrow=narrow) for name, settings, narrow in cases
    ]
    parts = [f"tau1 to tau11 grown by {item.name}\n{growth_table(item.growth)}" for item in found]
    return "\n\n".join([*parts, comparison_table(found, model_ship()[0].model.names), ""])


def _trials_part(options: GrowSettings) -> str:
    minutes, growths = minutes_for_the_same(options)
    parts = [
        f"Standard trials of the 30 m ship grown by {name}\n{growth_table(item)}" for name, item in growths.items()
    ]
    rows = [f"{row.name:<12} {row.same:>16.2f} {row.no_worse:>26.2f} {row.wind:>10.2f}" for row in minutes]
    head = f"{'minutes for':<12} {'same determinant':>16} {'hull, thrusters no worse':>26} {'wind':>10}"
    return "\n\n".join([*parts, "\n".join(["Against one set of standard trials", head, *rows])])


if __name__ == "__main__":
    main()
