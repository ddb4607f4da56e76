"""Do the 95 % intervals of `indices` hold the next trial of a ship whose model was estimated from a few runs?

Ships are drawn around the coaster. Each sails a circle and zig-zags 10/10 and 20/20 to starboard, measured with noise;
`estimate` joins them with what is known of the coaster. She then sails the same to port, and the results are compared
with the intervals of the estimated vessel. The ships are

- as the model: of its structure, in calm water,
- gusty: the same, pushed by forces that wander, in every run and every trial by others, so that trials differ,
- unlike the model: in calm water, with cubic forces of drift and yaw rate, which the model lacks.

Beside the intervals stand those by the parameters alone, and those by `SCATTER`, which a vessel without data has.

    PYTHONPATH=tests/benchmarks python tests/benchmarks/trial_intervals.py --ships 8 --seed 0
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.assessment import EstimateOptions, assess
from expdesign.export.files import estimated_vessel
from expdesign.particulars import Trial, expected
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.simulation import steady_ahead
from expdesign.simulation.motion import motion_rates
from expdesign.vessel import Missed, Term, Vessel, VesselModel

FILE = Path(__file__).parents[2] / "scenarios" / "vessels" / "coaster-80m.toml"
SPEED, HARD = 4.5, math.radians(35.0)
STEP_S = 0.5
TEN, TWENTY = math.radians(10.0), math.radians(20.0)
TRIALS = (
    Trial(kind="circle", speed_mps=SPEED, angle_rad=HARD),
    Trial(kind="zigzag", speed_mps=SPEED, angle_rad=TEN),
    Trial(kind="zigzag", speed_mps=SPEED, angle_rad=TWENTY),
)
NOISE = np.array([0.5, 0.5, 0.002, 0.02, 0.02, 2e-5])  # of pose and velocity
TINY = 1e-9  # of intervals that begin at nothing
WIDTH = 0.1  # standard deviation of drawn parameters, as a share
# accelerations that wander, standard deviations [m/s2, m/s2, rad/s2] and time [s]: the overshoots of one ship differ by
# a fifth, her advance by a few per cent
GUSTS, GUST_S = np.array([0.004, 0.008, 1.0e-4]), 40.0
CUBES = {"Y_vvv": ("v", "v*v*v", -2e-3), "N_vvv": ("r", "v*v*v", -2e-5), "N_rrr": ("r", "r*r*r", -30.0)}
KINDS = ("as the model", "gusty", "unlike the model")


def drawn(kind: str, ship: Vessel, rng: np.random.Generator) -> VesselModel:
    """The model of a true ship."""
    model = ship.model
    true = model.with_parameters(model.drawn_parameters(1, rng)[0])
    if kind != "unlike the model":
        return true
    more = tuple(Term(equation, name, text) for name, (equation, text, _) in CUBES.items())
    sizes = np.array([size for *_, size in CUBES.values()])
    values = np.concatenate([true.parameters, sizes * rng.uniform(0.3, 1.0, len(sizes))])
    return replace(
        true, terms=(*true.terms, *more), parameters=values, parameter_std=np.zeros(len(values)),
        parameter_correlation={}, parameter_range={}, unstated_std={},
    )  # fmt: skip


def sailed(
    model: VesselModel, ship: Vessel, helm: Callable[[np.ndarray], float], last_s: float, gusts: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """States (k, 6) and inputs (k, m) of a run from a steady course north; the helm's order follows from the state."""
    approach = steady_ahead(replace(ship, model=model), SPEED)
    rate, angle = math.radians(2.32), 0.0
    state = np.array([0.0, 0.0, 0.0, *approach.velocity[:3]])
    states, inputs = [], []
    count = round(last_s / STEP_S)
    for number in range(count):
        order = approach.starboard * helm(state)
        angle += float(np.clip(order - angle, -rate * STEP_S, rate * STEP_S))
        given = np.array(approach.helm.inputs(approach.drive, angle))
        states.append(state)
        inputs.append(given)
        push = np.zeros(3) if gusts is None else gusts[number]

        def rates(x: np.ndarray, given: np.ndarray = given, push: np.ndarray = push) -> np.ndarray:
            found = np.array(motion_rates(model, tuple(x), tuple(given)), dtype=float)
            found[3:] += push
            return found

        k1 = rates(state)
        k2 = rates(state + STEP_S / 2 * k1)
        k3 = rates(state + STEP_S / 2 * k2)
        state = state + STEP_S / 6 * (k1 + 2 * k2 + 2 * k3 + rates(state + STEP_S * k3))
    return np.array(states), np.array(inputs)


def hard_over(side: float) -> Callable[[np.ndarray], float]:
    """Helm of a circle to starboard (1) or port (-1)."""
    return lambda _: side * HARD


def reversing(angle: float, side: float) -> Callable[[np.ndarray], float]:
    """Helm of a zig-zag that begins to starboard (1) or port (-1)."""
    now = side

    def helm(state: np.ndarray) -> float:
        nonlocal now
        if now * state[2] >= angle:
            now = -now
        return now * angle

    return helm


def wandering(kind: str, count: int, rng: np.random.Generator) -> np.ndarray | None:
    """Accelerations (k, 3) that push her."""
    if kind != "gusty":
        return None
    kept = math.exp(-STEP_S / GUST_S)
    found = np.empty((count, 3))
    found[0] = rng.standard_normal(3)
    for number in range(1, count):
        found[number] = kept * found[number - 1] + math.sqrt(1 - kept**2) * rng.standard_normal(3)
    return found * GUSTS


def results(states: np.ndarray, trial: Trial, side: float) -> dict[str, float]:
    """Quantity -> value of a circle or zig-zag, inf where she does not come to it."""
    turned, time = side * states[:, 2], STEP_S * np.arange(len(states))

    def at(angle: float, what: np.ndarray) -> float:
        there = int(np.argmax(turned >= angle))
        if not turned[there] >= angle:
            return math.inf
        share = (angle - turned[there - 1]) / (turned[there] - turned[there - 1])
        return float(what[there - 1] + share * (what[there] - what[there - 1]))

    if trial.kind == "circle":
        half, quarter = math.pi, math.pi / 2
        return {
            "advance_m": at(quarter, states[:, 0]), "transfer_m": at(quarter, side * states[:, 1]),
            "tactical_diameter_m": at(half, side * states[:, 1]), "time_90_s": at(quarter, time),
            "time_180_s": at(half, time), "speed_180_mps": at(half, np.hypot(states[:, 3], states[:, 4])),
        }  # fmt: skip
    first = int(np.argmax(turned >= trial.angle_rad))
    back = first + int(np.argmax(turned[first:] < trial.angle_rad))
    second = back + int(np.argmax(turned[back:] <= -trial.angle_rad))
    again = second + int(np.argmax(turned[second:] > -trial.angle_rad))
    return {
        "overshoot_1_rad": float(turned[first:back].max() - trial.angle_rad) if back > first else math.inf,
        "overshoot_2_rad": float(-turned[second:again].min() - trial.angle_rad) if again > second > back else math.inf,
    }


def helm_of(trial: Trial, side: float) -> Callable[[np.ndarray], float]:
    return hard_over(side) if trial.kind == "circle" else reversing(trial.angle_rad, side)


def estimated(kind: str, model: VesselModel, ship: Vessel, folder: Path, rng: np.random.Generator) -> Vessel:
    """The vessel that `estimate` finds from her three runs."""
    batches = []
    for trial in TRIALS:
        count = 1000 if trial.kind == "circle" else 800
        states, inputs = sailed(model, ship, helm_of(trial, 1.0), count * STEP_S, wandering(kind, count, rng))
        seen = states + NOISE * rng.standard_normal(states.shape)
        batches.append(
            Batch(
                name=f"{trial.kind} {math.degrees(trial.angle_rad):.0f}", sample_time_s=STEP_S,
                input_names=ship.model.inputs, inputs=inputs, velocity=seen[:, 3:], pose=seen[:, :3],
            )
        )  # fmt: skip
    options = EstimateOptions(methods=("ls", "iv", "oe"), prior="parameter_std")
    found = assess(ship, Record(batches=tuple(batches)), options)
    path = folder / "estimated.toml"
    path.write_text(estimated_vessel(found, ship, command=""), "utf-8")
    return load_vessel(path)


def row(kind: str, ships: int, seed: int) -> str:
    """The table's row of a kind of ships."""
    inside: dict[str, list[bool]] = {"data": [], "parameters": [], "SCATTER": []}
    widths: dict[str, list[float]] = {name: [] for name in inside}
    of_ships: dict[str, list[float]] = {name: [] for name in inside}
    for number in range(ships):
        rng = np.random.default_rng([seed, KINDS.index(kind), number])
        ship = load_vessel(FILE)
        ship = replace(ship, model=replace(
            ship.model, parameter_std=WIDTH * np.abs(ship.model.parameters), parameter_correlation={}
        ))  # fmt: skip
        true = drawn(kind, ship, rng)
        with tempfile.TemporaryDirectory() as folder:
            found = estimated(kind, true, ship, Path(folder), rng)
        trials = {}
        for trial in TRIALS:
            count = 1000 if trial.kind == "circle" else 800
            states, _ = sailed(true, ship, helm_of(trial, -1.0), count * STEP_S, wandering(kind, count, rng))
            trials |= {(trial, name): value for name, value in results(states, trial, -1.0).items()}
        for name, missed in {
            "data": found.model.missed, "parameters": Missed(way_share=0.0, turn_share=0.0), "SCATTER": None
        }.items():  # fmt: skip
            one = expected(replace(found, model=replace(found.model, missed=missed)), TRIALS)
            held = [
                (item.low <= trials[item.trial, item.quantity] <= item.high, math.log(item.high / max(item.low, TINY)))
                for item in one if (item.trial, item.quantity) in trials
            ]  # fmt: skip
            inside[name] += [within for within, _ in held]
            widths[name] += [width for _, width in held]
            of_ships[name].append(float(np.mean([within for within, _ in held])))
    cells = [
        f"{sum(inside[name])} of {len(inside[name])} "
        f"({np.mean(inside[name]):.0%} ± {np.std(of_ships[name], ddof=1) / math.sqrt(ships):.0%}) | "
        f"{math.expm1(float(np.median(widths[name]))):.0%}"
        for name in inside
    ]
    return f"| {kind} | {ships} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ships", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=KINDS, action="append")
    asked = parser.parse_args()
    print("| ships | number | by data: within 95 % | wide | parameters alone | wide | SCATTER | wide |")
    print("|---|---|---|---|---|---|---|---|")
    for kind in asked.kind or KINDS:
        print(row(kind, asked.ships, asked.seed), flush=True)


if __name__ == "__main__":
    main()
