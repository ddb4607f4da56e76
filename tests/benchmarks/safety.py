"""Whole trials of drawn ships in drawn weather: how many leave allowed water?

Run with the package installed: ``python tests/benchmarks/safety.py [DRAWS] [SCENARIO.toml ...]``, by default 500 draws
of helsinki, narrows and model-ship. One draw is one trial. The nominal model and the forecast's mean current are all
that the helmsman of `expdesign.plan.steering` knows; he sees the true state. He follows each leg from wherever the run
before has left the ship and waits for a ship that lags. Then, by one of two procedures, the run begins and is sailed
open loop from the state the ship really has:

- *begun in place*, what a plan's promise is about: a ship that a leg has not brought to within `TOLERANCES` of the
  run's planned start goes back, runs up on the planned heading at the planned speed, steered, and the run begins when
  it is nearest to the planned position. How it gets to the beginning of the run-up is not simulated.
- *without a break*: nobody goes back.

What runs leave is compared with the promise; legs are no part of it and are told apart. Slow actuators are not covered:
the helmsman does not know them.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import joblib
import numpy as np
import shapely

from expdesign import workflows
from expdesign.conventions import wrap_angle
from expdesign.plan import Leg, Plan
from expdesign.plan.capability import capability
from expdesign.plan.safety import _leaves
from expdesign.plan.steering import LEAD, Helmsman, Reference
from expdesign.plan.uncertainty import draw_truths
from expdesign.scenario import load_scenario
from expdesign.scenario.values import Scenario
from expdesign.simulation import simulate_many

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = ("model-ship", "narrows", "helsinki")
TOLERANCES = (0.1, np.radians(3.0), 0.05)
"""Offset in hull lengths, heading [rad], and speed in transit speeds, from which on a ship goes back."""
KINDS = {"runs": "primitive", "legs": "reposition"}
RUN_UP = 4.0
"""Time constants of the way back to the track that a run-up lasts."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fleet:
    """Drawn ships: where they are, the commands standing, what is true of them, and who steers."""

    helm: Helmsman
    truth: dict[str, np.ndarray]
    states: np.ndarray
    before: np.ndarray

    def moved(self, values: np.ndarray, states: np.ndarray, before: np.ndarray, ships: np.ndarray) -> np.ndarray:
        """(k + 1, n, 6) of some ships under commands (n, k, m)."""
        truth = {name: item[ships] for name, item in self.truth.items()}
        vessel = self.helm.vessel
        return simulate_many(vessel, values, pose=states[:, :3], velocity=states[:, 3:], standing=before, **truth)

    def steered(
        self, reference: Reference, states: np.ndarray, before: np.ndarray, ships: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """States (k, n, 6) until every ship has come to the reference's end, and commands (k, n, m) standing there."""
        end = len(reference.states) - 1
        sample, rows, given = np.zeros(len(states)), [states], [before]
        for _ in range(2 * end + 2):
            going = sample < end
            if not going.any():
                break
            pace = reference.pace(sample, states, self.helm.vessel.length_m / 2)
            sample = np.minimum(sample + pace * going, end)
            before = np.where(going[:, None], self.helm.commands(reference.at(sample), states, before), before)
            states = np.where(going[:, None], self.moved(before[:, None], states, before, ships)[-1], states)
            rows.append(states)
            given.append(before)
        return np.array(rows), np.array(given)


def off_place(fleet: Fleet, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) distance from a planned state (6,), and whether that or heading or speed is beyond tolerance."""
    far, turned, fast = TOLERANCES
    apart = fleet.states - wanted
    off_m = np.hypot(*apart[:, :2].T)
    beyond = off_m > far * fleet.helm.vessel.length_m
    beyond |= np.abs(wrap_angle(apart[:, 2])) > turned
    beyond |= np.hypot(*apart[:, 3:5].T) > fast * fleet.helm.ship.transit_speed_mps
    return off_m, beyond


def run_up(fleet: Fleet, wanted: np.ndarray, before: np.ndarray, back: np.ndarray) -> Fleet:
    """Ships `back` (n,) brought to a planned state (6,) once more, by steady motion towards it."""
    ships, sample_s = np.flatnonzero(back), fleet.helm.vessel.sample_time_s
    if not len(ships):
        return fleet
    reach_s = RUN_UP * LEAD * fleet.helm.answer_s
    after_s = min(fleet.helm.vessel.length_m / (np.hypot(*wanted[3:5]) + 1e-9), reach_s)
    reference = Reference(states=steady(wanted, np.arange(-reach_s, after_s + sample_s, sample_s)))
    begin = np.tile(reference.states[0], (len(ships), 1))
    rows, given = fleet.steered(reference, begin, np.tile(before, (len(ships), 1)), ships)
    nearest = np.hypot(*np.moveaxis(rows[1:, :, :2] - wanted[:2], -1, 0)).argmin(axis=0) + 1
    states, standing, chosen = fleet.states.copy(), fleet.before.copy(), np.arange(len(ships))
    states[ships], standing[ships] = rows[nearest, chosen], given[nearest, chosen]
    return Fleet(helm=fleet.helm, truth=fleet.truth, states=states, before=standing)


def steady(wanted: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """(k, 6) states before and after a state (6,) that keeps its speed over ground, its course and its heading."""
    c, s = np.cos(wanted[2]), np.sin(wanted[2])
    north, east = wanted[3] * c - wanted[4] * s, wanted[3] * s + wanted[4] * c
    states = np.tile(wanted, (len(time_s), 1))
    states[:, :2] += time_s[:, None] * [north, east]
    states[:, 5] = 0.0
    return states


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """Which trials leave, by leg (legs, n), which went back before a run, and how far off runs began [m]."""

    leaves: np.ndarray
    back: np.ndarray
    off_m: np.ndarray


def sailed(case: Scenario, plan: Plan, *, draws: int, in_place: bool, rng: np.random.Generator) -> Outcome:
    """Drawn trials of a plan."""
    vessel = case.vessel
    parameters, current, wind = draw_truths(vessel, case.environment, draws, rng)
    track, everyone = np.hstack([plan.trajectory.pose, plan.trajectory.velocity]), np.arange(draws)
    fleet = Fleet(
        helm=Helmsman(vessel=vessel, environment=case.environment, ship=capability(vessel, case.plan)),
        truth={"parameters": parameters, "current_to": current, "wind_to": wind},
        states=np.tile(track[0], (draws, 1)),
        before=np.zeros((draws, len(vessel.limits))),
    )
    shapely.prepare(case.area.water)
    leaves, back, off = np.zeros((3, len(plan.legs), draws))
    for index, leg in enumerate(plan.legs):
        if leg.kind == "primitive":
            wanted, standing = track[leg.first], plan.commands.values[max(leg.first - 1, 0)]
            if in_place:
                back[index] = off_place(fleet, wanted)[1]
                fleet = run_up(fleet, wanted, standing, back[index] > 0)
            off[index] = off_place(fleet, wanted)[0]
            values = np.tile(plan.commands.values[leg.first : leg.last], (draws, 1, 1))
            rows, last = fleet.moved(values, fleet.states, fleet.before, everyone), values[:, -1]
        else:
            reference = Reference(states=track[leg.first : leg.last + 1])
            rows, given = fleet.steered(reference, fleet.states, fleet.before, everyone)
            last = given[-1]
        leaves[index] = _leaves(case.area, vessel, rows)
        fleet = Fleet(helm=fleet.helm, truth=fleet.truth, states=rows[-1], before=last)
    return Outcome(leaves=leaves > 0, back=back > 0, off_m=off)


def many(case: Scenario, plan: Plan, *, draws: int, in_place: bool, seed: int = 7, parts: int = 2) -> Outcome:
    """The same, divided among processor cores."""
    seeds = np.random.default_rng(seed).spawn(parts)
    found = joblib.Parallel(n_jobs=parts)(
        joblib.delayed(sailed)(case, plan, draws=-(-draws // parts), in_place=in_place, rng=rng) for rng in seeds
    )
    return Outcome(
        **{name: np.concatenate([getattr(x, name) for x in found], axis=1) for name in ("leaves", "back", "off_m")}
    )


def share_of(kind: str, legs: tuple[Leg, ...], leaves: np.ndarray) -> tuple[float, float]:
    """Share of trials that leave in some leg of a kind, and its standard error."""
    left = leaves[[leg.kind == kind for leg in legs]].any(axis=0)
    share = float(left.mean())
    return share, float(np.sqrt(max(share * (1 - share), 1 / len(left)) / len(left)))


def report(case: Scenario, plan: Plan, draws: int) -> None:
    """Print what leaves by either procedure, and by leg where anything does."""
    print(f"\n{case.name}: promised at most {1.0 - case.plan.confidence:.1%}")
    runs = [leg.kind == "primitive" for leg in plan.legs]
    for in_place in (True, False):
        found = many(case, plan, draws=draws, in_place=in_place)
        parts = {name: share_of(kind, plan.legs, found.leaves) for name, kind in KINDS.items()}
        print(
            f"  {'begun in place' if in_place else 'without a break':15s} {found.leaves.shape[1]} trials:",
            *(f"{name} {share:.2%} +- {error:.2%}," for name, (share, error) in parts.items()),
            f"either {found.leaves.any(axis=0).mean():.2%}; {found.back[runs].mean():.0%} of runs after going back; "
            f"runs begin {np.median(found.off_m[runs]):.2f} m off in the middle, "
            f"{np.quantile(found.off_m[runs], 0.95):.2f} m in 95 %",
            flush=True,
        )
        for leg, leaves in zip(plan.legs, found.leaves, strict=True):
            if leaves.any():
                print(f"    {leg.kind:10s} {leg.name:28s} {leaves.mean():.1%}")


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    for path in sys.argv[2:] or [str(SCENARIOS / f"{name}.toml") for name in NAMES]:
        scenario = load_scenario(path)
        information = workflows.scored(scenario)
        report(scenario, workflows.planned(scenario, information, workflows.designed(scenario, information)), number)
