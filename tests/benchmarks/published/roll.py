"""Roll and loads in simulated data: `python tests/benchmarks/published/roll.py STUDY [--runs N] [--seed N]`.

moment: least squares and instruments on a pendulum under narrow-band roll moments, without sensor noise.
pendulum: the pendulum's own parameters and its load from noisy sensors, in two stages and jointly.
ship: nine parameters less a known k from three load cases of a model ship, the error of the mass beside it.
waves: the same under a strong narrow-band roll moment.
autopilot: the same under a moderate one, with an autopilot that moves the rudder by heading and yaw rate.
feedback: the same and waves, with a rudder that answers the roll rate too; instruments from it, or from its orders.
fullscale: ten minutes for each load of the ship 24 times as long, whose rudder is slow.
loads: what load cases determine.
claims: the thesis's own pendulum study, 25 minutes for each load, in stages, after its strong filter and ours.
records: errors under a narrow-band roll moment by the length of the record.
tilting: its tilting test, whose geometry is not stated and follows from two of its three rows.

All tell how often 95 % intervals hold the truth, how many estimates say that theirs are not to be trusted, and how many
misses no estimate warned of. Parameters are those of the thesis where it states them; excitation, sensor noise of the
ship and her sway and yaw are ours, as the thesis does not state them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy

from expdesign.roll import (
    NOMINAL,
    PARAMETERS,
    Case,
    Load,
    RollEstimate,
    RollProblem,
    build_problem,
    estimate_roll,
    low_pass,
    prepared,
    relative_sensitivity,
)
from expdesign.values import Array

sys.path.insert(0, str(Path(__file__).parents[2]))

from roll_truths import (
    CASES,
    MODEL_SHIP,
    MODEL_SHIP_TRUTH,
    PENDULUM,
    PENDULUM_TRUTH,
    Helm,
    Sea,
    full_scale_problem,
    pendulum_run,
    ship_run,
    switching,
    unknown_load,
)

LOAD = Load(mass_kg=0.2, z_m=-0.274)
OWN, LOADED = ("A_x", "d"), ("m", "z_m")
SHIP_SEA = Sea(roll_rate=0.005, sensed=0.01, yaw_rate=0.005, moment=0.02, frequency_hz=0.8, damping=0.3)
WAVES = Sea(roll_rate=0.005, sensed=0.01, yaw_rate=0.005, moment=0.2, frequency_hz=0.8, damping=0.05)
AUTOPILOT_SEA = Sea(roll_rate=0.005, sensed=0.01, yaw_rate=0.005, moment=0.1, frequency_hz=0.8, damping=0.1)


def truth(theta: Array, name: str) -> float:
    """A parameter by name."""
    return float(theta[PARAMETERS.index(name)])


def pendulum_problem(cases: tuple[Case, ...], free: Iterable[str], theta: Array) -> RollProblem:
    """The pendulum with all but some parameters as in theta, and a rough start."""
    known = {name: truth(theta, name) for name in PARAMETERS if name not in free}
    return build_problem(PENDULUM, cases, beam_m=0.3, roll_hz=1.0, known=known, start={"m": 0.1, "z_m": -0.2})


def pendulum_case(load: Load | None, sea: Sea, samples: int, rng: np.random.Generator) -> Case:
    """A run of a pendulum whose cart goes back and forth every 2 s at random."""
    run = pendulum_run(load or LOAD, switching(samples, 200, rng), sea, rng)
    return Case(name="pendulum", load=load, runs=(run,))


def moment(runs: int, seed: int) -> None:
    """Inertia and damping with k known, 5 minutes at 100 Hz; the wider moment first."""
    for damping in (0.1, 0.03):
        for rms in (0.1, 0.3):
            sea = Sea(moment=rms, frequency_hz=1.0, damping=damping)
            found: dict[str, list[RollEstimate]] = {"ls": [], "iv": []}
            for number in range(runs):
                case = pendulum_case(NOMINAL, sea, 30_000, np.random.default_rng([seed, number]))
                for method, rows in found.items():
                    rows.append(estimate_roll(pendulum_problem((case,), OWN, PENDULUM_TRUTH), method=method))
            for method, rows in found.items():
                cells = [_cell(rows, name, truth(PENDULUM_TRUTH, name)) for name in OWN]
                print(
                    f"| {damping} | {rms} | {method} | {' | '.join(cells)} | {_held(rows, PENDULUM_TRUTH)} |",
                    flush=True,
                )


def pendulum(runs: int, seed: int) -> None:
    """Sensors with standard deviations of 0.01 each, 5 minutes for each load."""
    sea = Sea(roll_rate=0.01, sensed=0.01)
    found: dict[str, list[RollEstimate]] = {}
    for number in range(runs):
        rng = np.random.default_rng([seed, number])
        both = pendulum_case(NOMINAL, sea, 30_000, rng), pendulum_case(None, sea, 30_000, rng)
        for method in ("ls", "iv"):
            first = estimate_roll(pendulum_problem(both[:1], OWN, PENDULUM_TRUTH), method=method)
            second = estimate_roll(pendulum_problem(both[1:], LOADED, first.theta), method=method)
            joint = estimate_roll(pendulum_problem(both, (*OWN, *LOADED), PENDULUM_TRUTH), method=method)
            for stage, one in (("stages: own", first), ("stages: load", second), ("jointly", joint)):
                found.setdefault(f"{stage} | {method}", []).append(one)
    for what, rows in found.items():
        cells = [
            _cell(rows, name, truth(PENDULUM_TRUTH, name)) if name in rows[0].problem.free else ""
            for name in (*OWN, *LOADED)
        ]
        print(f"| {what} | {' | '.join(cells)} |")


def ship(runs: int, seed: int, sea: Sea = SHIP_SEA, helm: Helm = (0.0, 0.0, 0.0)) -> None:
    """A minute at 100 Hz for each of no load, a known one and an unknown one."""
    found: dict[str, list[RollEstimate]] = {"iv": [], "ls": []}
    for number in range(runs):
        problem = ship_problem(sea, np.random.default_rng([seed, number]), helm)
        for method, rows in found.items():
            rows.append(estimate_roll(problem, method=method))
    for name in found["iv"][0].problem.free:
        cells = [_cell(rows, name, truth(MODEL_SHIP_TRUTH, name)) for rows in found.values()]
        print(f"| {name} | {truth(MODEL_SHIP_TRUTH, name):g} | {' | '.join(cells)} |")
    for method, rows in found.items():
        errors = [abs(one.values["m"] - 0.4) / 0.4 for one in rows]
        told = f"median error of the mass {100 * np.median(errors):.1f} %"
        print(f"{method}: {told}; {_held(rows, MODEL_SHIP_TRUTH)}")


def ship_problem(
    sea: Sea, rng: np.random.Generator, helm: Helm = (0.0, 0.0, 0.0), *, planned: bool = False
) -> RollProblem:
    """Three load cases of the model ship, k known; `planned` makes instruments from the rudder orders."""
    cases = []
    for load in CASES:
        orders = switching(6000, 150, rng, levels=(-0.6, 0.0, 0.6))
        run = ship_run(load or unknown_load(), orders, sea, rng, step_s=0.01, helm=helm)
        cases.append(Case(name="ship", load=load, runs=(replace(run, planned=orders if planned else None),)))
    return build_problem(MODEL_SHIP, tuple(cases), beam_m=0.3, roll_hz=0.75, known={"k": 9.0}, start={})


def waves(runs: int, seed: int) -> None:
    """The ship where waves roll her more than her rudder does."""
    ship(runs, seed, WAVES)


def autopilot(runs: int, seed: int) -> None:
    """The ship in waves, held on course by an autopilot that answers heading and yaw rate."""
    ship(runs, seed, AUTOPILOT_SEA, helm=(1.0, 1.0, 0.0))


def _cell(rows: list[RollEstimate], name: str, wanted: float) -> str:
    """Median, robust standard deviation, median of those told, and share of 95 % intervals that hold."""
    values, told = np.array([[one.values[name], one.std[name]] for one in rows]).T
    spread = np.subtract(*np.percentile(values, [75, 25])) / 1.349
    held = 100 * np.mean(np.abs(values - wanted) < 1.96 * told)
    return f"{np.median(values):.4f} ± {spread:.4f} ({np.median(told):.4f}, {held:.0f} %)"


def _held(rows: list[RollEstimate], wanted: Array) -> str:
    """How many intervals hold the truth, how many estimates warn of theirs, and misses without a warning."""
    held = [
        [abs(one.values[name] - truth(wanted, name)) < 1.96 * one.std[name] for name in one.problem.free]
        for one in rows
    ]
    warned = [not one.trusted for one in rows]
    missed = sum(own.count(False) for own, told in zip(held, warned, strict=True) if not told)
    return (
        f"{100 * np.mean(held):.1f} % of {np.size(held)} intervals hold; {sum(warned)} of {len(rows)} estimates warn; "
        f"{missed} misses without a warning"
    )


def feedback(runs: int, seed: int) -> None:
    """Intervals, and how many say that the rudder answers, by the gain of the roll rate; it damps where positive."""
    for what, sea in (("0.1 N m, damping 0.1", AUTOPILOT_SEA), ("0.2 N m, damping 0.05", WAVES)):
        for gain in (0.0, -0.5, 0.5, 1.0):
            for planned in (False, True):
                rows = [
                    estimate_roll(
                        ship_problem(sea, np.random.default_rng([seed, number]), (1.0, 1.0, gain), planned=planned)
                    )
                    for number in range(runs)
                ]
                said = sum(one.answering for one in rows)
                source = "orders" if planned else "rudder"
                print(f"| {what} | {gain:g} | {source} | {said} | {_held(rows, MODEL_SHIP_TRUTH)} |", flush=True)


def fullscale(runs: int, seed: int) -> None:
    """Intervals, strength and the standard deviation told of the mass, by rudder rate and roll moment."""
    for rate in (3.0, 6.0, 20.0):
        for moment_nm in (2e3, 7e3, 30e3):
            pairs = [full_scale_problem(rate, moment_nm, np.random.default_rng([seed, n])) for n in range(runs)]
            wanted = pairs[0][0]
            rows = [estimate_roll(problem) for _, problem in pairs]
            told = np.median([one.std["m"] for one in rows]) / truth(wanted, "m")
            strong = np.median([one.strength for one in rows])
            print(f"| {rate:g} | {moment_nm:g} | {100 * told:.0f} | {strong:.1f} | {_held(rows, wanted)} |", flush=True)


def loads(runs: int, seed: int) -> None:
    """Rank and smallest relative singular value of all nine parameters, by load cases; nothing is drawn."""
    theta = np.array([9.0067, 0.1566, 0.2668, -1.9911, 0.9408, -0.4433, -0.0293, 0.369, -0.2426])
    more: dict[str, list[Load]] = {
        "none, known, unknown": [],
        "and 0.4 kg at the same height": [Load(mass_kg=0.4, z_m=-0.256)],
        "and 0.4 kg at -0.268 m": [Load(mass_kg=0.4, z_m=-0.268)],
        "and 0.6 kg at -0.280 m": [Load(mass_kg=0.6, z_m=-0.280)],
        "and 0.4 kg at -0.05 m": [Load(mass_kg=0.4, z_m=-0.05)],
        "and 2 kg at 0.10 m": [Load(mass_kg=2.0, z_m=0.10)],
    }
    for what, added in more.items():
        sensitivity = relative_sensitivity(theta, MODEL_SHIP, [*CASES, *added], PARAMETERS)
        sizes = np.linalg.svd(sensitivity, compute_uv=False)
        print(f"| {what} | {np.count_nonzero(sizes > 1e-9 * sizes[0])} of 9 | {sizes[-1]:.1e} |")


def claims(runs: int, seed: int) -> None:
    """Inertia and damping of the pendulum, then its load from them, sensors with standard deviations of 0.01."""
    sea, tables = Sea(roll_rate=0.01, sensed=0.01), dict[str, list[list[float]]]()
    for number in range(runs):
        rng = np.random.default_rng([seed, number])
        raw = pendulum_case(NOMINAL, sea, 150_000, rng), pendulum_case(None, sea, 150_000, rng)
        for cutoff_hz in (3.3, None):
            both = prepared(raw, low_pass(raw, roll_hz=1.0, cutoff_hz=cutoff_hz))
            for method in ("ls", "iv"):
                own = estimate_roll(pendulum_problem(both[:1], OWN, PENDULUM_TRUTH), method=method)
                load = estimate_roll(pendulum_problem(both[1:], LOADED, own.theta), method=method)
                row = [*(own.values[name] for name in OWN), *(load.values[name] for name in LOADED)]
                tables.setdefault(f"{f'{cutoff_hz:g} Hz' if cutoff_hz else 'ours'} | {method}", []).append(row)
    for what, rows in tables.items():
        found = np.array(rows)
        wanted = [truth(PENDULUM_TRUTH, name) for name in (*OWN, *LOADED)]
        told = zip(np.mean(found - wanted, axis=0), found.std(axis=0, ddof=1), strict=True)
        near = 100 * np.mean(np.abs(found[:, 2] - LOAD.mass_kg) < 0.1)
        shares = f"{100 * np.mean(found[:, 2] > 0):.0f} % | {near:.0f} % | {100 * np.mean(found[:, 2] > 0.1):.0f} %"
        print(f"| {what} | {' | '.join(f'{bias:+.1e} ± {std:.1e}' for bias, std in told)} | {shares} |")


def records(runs: int, seed: int) -> None:
    """Mean error of inertia and damping, in percent, with its standard error, by the length of the record."""
    sea = Sea(moment=0.1, frequency_hz=1.0, damping=0.1)
    wanted = np.array([truth(PENDULUM_TRUTH, name) for name in OWN])
    for samples in (6000, 24_000, 96_000):
        for method in ("ls", "iv"):
            cases = [pendulum_case(NOMINAL, sea, samples, np.random.default_rng([seed, n])) for n in range(runs)]
            rows = [estimate_roll(pendulum_problem((case,), OWN, PENDULUM_TRUTH), method=method) for case in cases]
            errors = 100 * (np.array([[one.values[name] for name in OWN] for one in rows]) / wanted - 1)
            told = zip(errors.mean(axis=0), errors.std(axis=0, ddof=1) / np.sqrt(runs), strict=True)
            cells = " | ".join(f"{mean:+.2f} ± {error:.2f}" for mean, error in told)
            print(f"| {samples // 6000} min | {method} | {cells} |", flush=True)


def tilting(runs: int, seed: int) -> None:
    """Height of the centre of mass by the third row of table 6.2, with levers and angle that the other two give.

    Supports at x_1 = -x_2 and so far below the reference line; nothing is drawn.
    """
    total, loads, readings = 22.685, [0.0, 0.2, 0.4], [(11.57, 14.690), (11.67, 14.850), (11.77, 15.015)]
    load_heights, centre = [0.0, -0.256, -0.268], [(-0.00178, 0.00728), (-0.00181, 0.00734), (-0.00185, None)]
    lever = total * centre[0][0] / (2 * readings[0][0] - total)

    def sums(row: int) -> tuple[float, float]:
        """Moments of the tilted ship along, and those of the load across, both over the cosine of the angle."""
        mass = total + loads[row]
        place = (lever * (2 * readings[row][0] - mass) - total * centre[row][0]) / (loads[row] or 1.0)
        along = lever * (2 * readings[row][1] - mass) - loads[row] * place - total * centre[row][0]
        return along, loads[row] * load_heights[row]

    def left(unknown: Array) -> list[float]:
        depth, slope = unknown.tolist()
        rows = [(sums(row), centre[row][1] or 0.0, total + loads[row]) for row in (0, 1)]
        return [along + slope * (up + total * z_g - mass * depth) for (along, up), z_g, mass in rows]

    depth, slope = scipy.optimize.fsolve(left, np.array([0.05, -0.4]))
    along, up = sums(2)
    height = ((total + loads[2]) * depth - up - along / slope) / total
    angle = np.degrees(np.arctan(slope))
    print(f"levers {lever:+.3f} m, {depth:+.3f} m, {angle:.1f} degrees; height {height:.4f} m, printed 0.0073 m")


STUDIES = {
    "moment": moment,
    "pendulum": pendulum,
    "ship": ship,
    "waves": waves,
    "autopilot": autopilot,
    "feedback": feedback,
    "fullscale": fullscale,
    "loads": loads,
    "claims": claims,
    "records": records,
    "tilting": tilting,
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", choices=STUDIES)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    STUDIES[asked.study](asked.runs, asked.seed)
