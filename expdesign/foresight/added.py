"""Whole runs of the dictionary that bring tests to the wanted power, at the least time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.motion import linearise, simulate_from_measured, stable_windows
from expdesign.dictionary import Primitive
from expdesign.foresight.effects import Direction, disturbance_at, lasting
from expdesign.foresight.information import JointInformation, allowed_by_prior, batch_information, beside_nuisance
from expdesign.foresight.power import needed_noncentrality, power
from expdesign.foresight.trial import Background, exact_record, run_of, weather_without_causes
from expdesign.foresight.values import WANTED_POWER, AddedRuns, Foreseen
from expdesign.simulation import Environment, simulate
from expdesign.values import Array
from expdesign.vessel import Vessel

MOST_ADDED_S = 14400.0  # longest time of added runs [s]
MOST_ADDED_RUNS = 200  # of one manoeuvre
HEADINGS = 2  # of every manoeuvre that may be added
ENDLESS = 1e5  # number of runs of every manoeuvre that stands for unlimited data


@dataclass(frozen=True, kw_only=True, eq=False)
class Offers:
    """Runs that may be added to a trial, with their information."""

    names: tuple[str, ...]  # (q,) of the manoeuvres
    run_s: Array  # (q,) duration of a run [s]
    known: Array  # (c + m, c + m) information of the trial as it is, about nuisance and about effects at their sizes
    each: Array  # (q, c + m, c + m) information of one run
    precision: Array  # (c, c) prior precision of the nuisance
    blocks: tuple[NDArray[np.int64], ...]  # per effect, its rows among the m; of several the worst mixture counts

    def noncentralities(self, runs: Array) -> Array:
        """(e,) noncentrality of every effect once so many runs (q,) are added."""
        A = beside_nuisance(self.known + np.tensordot(runs, self.each, axes=1), self.precision)
        return np.array([np.linalg.eigvalsh(A[np.ix_(index, index)])[0] for index in self.blocks])

    @property
    def most(self) -> NDArray[np.int64]:
        """(q,) largest number of runs of one manoeuvre."""
        return np.maximum(np.minimum(MOST_ADDED_S // self.run_s, MOST_ADDED_RUNS), 1).astype(int)


def information_of_runs(
    vessel: Vessel,
    base: Fit,
    primitives: Sequence[Primitive],
    weather: Environment,
    directions: Sequence[Direction],
    sizes: Sequence[float],
) -> Array:
    """(q, c + m, c + m) information of one run of each manoeuvre, the mean over `HEADINGS` first headings.

    Args:
        base: fit of the trial that the runs are added to: its model, nuisance and noise.
        primitives: q manoeuvres.
        directions: m effects; a change of the ship has happened before the runs.
    """
    calm = weather_without_causes(vessel, weather)
    turns = np.arange(HEADINGS) * (np.pi / HEADINGS)
    sailed = []
    for primitive in primitives:
        for turn in turns.tolist():
            run = run_of(primitive, turn)
            motion = simulate(
                vessel,
                run.commands,
                pose=run.pose,
                velocity=run.velocity,
                environment=calm,
                standing=run.standing,
            )
            sailed.append((primitive.name, run.commands, motion))
    record = exact_record(sailed, calm.wind_to)
    windows = stable_windows(base.ship, record)
    linear = linearise(simulate_from_measured(base.ship, windows))
    disturbances = [disturbance_at(linear, lasting(item), size) for item, size in zip(directions, sizes, strict=True)]
    found = batch_information(linear, base.keys, disturbances, base.noise)
    whole = np.zeros((len(sailed), *found.shape[1:]))
    whole[np.unique(windows.batch).astype(int)] = found  # a run of a few samples tells nothing
    return np.asarray(whole.reshape(len(primitives), len(turns), *found.shape[1:]).mean(axis=1))


def of_one_manoeuvre(offers: Offers, needed: Array) -> list[tuple[AddedRuns | None, float]]:
    """Per effect, the runs of one manoeuvre that bring it soonest to a noncentrality, and its largest one.

    Args:
        offers: runs that may be added.
        needed: (e,) noncentrality of every effect.
    """
    best: list[tuple[AddedRuns | None, float]] = [(None, 0.0)] * len(needed)
    for q, name in enumerate(offers.names):
        unit = np.eye(len(offers.names))[q]
        reached: dict[int, Array] = {}

        def at(count: int, unit: Array = unit, reached: dict[int, Array] = reached) -> Array:
            if count not in reached:
                reached[count] = offers.noncentralities(count * unit)
            return reached[count]

        for effect, goal in enumerate(needed):
            most = int(offers.most[q])
            runs, largest = best[effect][0], max(best[effect][1], float(at(most)[effect]))
            if at(most)[effect] >= goal:
                low, high = 0, most
                while high - low > 1:
                    middle = (low + high) // 2
                    low, high = (low, middle) if at(middle)[effect] >= goal else (middle, high)
                time_s = float(high * offers.run_s[q])
                if runs is None or time_s < runs.time_s:
                    runs = AddedRuns(runs=((name, high),), time_s=time_s)
            best[effect] = runs, largest
    return best


def together(offers: Offers, needed: Array) -> AddedRuns | None:
    """Runs that bring all effects to their noncentralities: the run that does most for its time, again and again.

    Then runs that are not needed any more are left out. None where the time allowed does not suffice.
    """
    runs, goal = np.zeros(len(offers.names)), np.maximum(needed, 1e-12)

    def missing(trial: Array) -> float:
        return float(np.maximum(1.0 - offers.noncentralities(trial) / goal, 0.0).sum())

    left, units = missing(runs), np.eye(len(offers.names))
    while left > 0.0:
        after = np.array([missing(runs + unit) for unit in units])
        q = int(np.argmax((left - after) / offers.run_s))
        runs = runs + units[q]
        if runs @ offers.run_s > MOST_ADDED_S or not after[q] < left:
            return None
        left = float(after[q])
    for q in np.argsort(-offers.run_s):
        while runs[q] and missing(runs - units[q]) == 0.0:
            runs = runs - units[q]
    chosen = tuple((name, int(count)) for name, count in zip(offers.names, runs, strict=True) if count)
    return AddedRuns(runs=chosen, time_s=float(runs @ offers.run_s))


def with_added_runs(
    vessel: Vessel,
    known: Background,
    joint: JointInformation,
    found: tuple[Foreseen, ...],
    primitives: Sequence[Primitive],
    weather: Environment,
) -> tuple[tuple[Foreseen, ...], AddedRuns | None]:
    """Effects that lack power with the runs that give it to them, and the runs that do so for all of these."""
    lacking = [number for number, item in enumerate(found) if item.needs_runs]
    if not primitives or not lacking:
        return found, None
    own = len(joint.directions) + len(known.base.keys)
    offers = Offers(
        names=tuple(item.name for item in primitives),
        run_s=np.array([item.duration_s for item in primitives]),
        known=joint.whole[:own, :own],
        each=information_of_runs(vessel, known.base, primitives, weather, joint.directions, joint.sizes),
        precision=known.base.precision,
        blocks=tuple(joint.blocks[number] for number in lacking),
    )
    items = [found[number] for number in lacking]
    needed = np.array([needed_noncentrality(WANTED_POWER, item.freedom, item.level) for item in items])
    single = of_one_manoeuvre(offers, needed)
    best = [float(power(largest, item.freedom, item.level)) for item, (_, largest) in zip(items, single, strict=True)]
    c, ever = len(known.base.keys), offers.known + ENDLESS * offers.each.sum(axis=0)
    places = [np.r_[np.arange(c), c + index] for index in offers.blocks]
    within = [
        allowed_by_prior(ever[np.ix_(place, place)], offers.precision, goal)
        for place, goal in zip(places, needed.tolist(), strict=True)
    ]
    changed = {
        number: replace(found[number], added=runs, best_power=most, within_std=is_within)
        for number, (runs, _), most, is_within in zip(lacking, single, best, within, strict=True)
    }
    kept = [place for place, (runs, _) in enumerate(single) if runs is not None]
    some = replace(offers, blocks=tuple(offers.blocks[place] for place in kept))
    more = together(some, needed[kept]) if kept else None
    return tuple(changed.get(number, item) for number, item in enumerate(found)), more
