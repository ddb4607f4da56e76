"""Yaw models of a naval vessel in operation: influence of noise, changes that show, and alarms, beside a thesis's.

``python tests/benchmarks/published/operation.py [--runs N] [--study S]``: voyages of 600 s at 10 Hz with pod angles and
speeds held for 12 to 40 s (calm orders). The thesis gives neither its excitation nor its anti-alias filter: here the
noise that it lists is averaged over 5 samples, and every fourth sample is used. Estimates are by output error from the
true parameters. Instruments are beyond the thesis. Alarms: voyages of 500 s with orders of their own, calm or brisk
(held for 5 to 20 s, up to 60 degrees, lag 1 s), noise averaged over 5 or 7 samples, the constants of the thesis's sum,
and constants calibrated so that 2 % of nominal voyages raise an alarm. A table of what the thesis says ends it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy

sys.path.insert(0, str(Path(__file__).parents[2]))
from dataclasses import replace

from expdesign.monitoring.yaw import (
    YAW_MODELS,
    YawData,
    YawModel,
    estimate_yaw,
    estimate_yaw_by_instruments,
    halves_differ,
    simulate_yaw,
    term_budget,
)
from naval_case import BRISK, CALM, STEP_S, exact, fleet, harbour, heavier, measured, measured_fleet, rotation, turn
from naval_ship import NOMINAL as SHIP
from naval_ship import YAW_TRUE, Hull, Pods, Voyage, pod_force
from yaw_detector import Detector, alarm_samples, excitation_rank

EVERY, PRIORS = 4, 5
FULL = YAW_MODELS["full"]
MEETS, WATCHED = "meet_the_thesis", "are_watched"  # ends of names of tests
EXCITATIONS = {"calm": CALM, "brisk": BRISK}
CONSTANTS = {
    ("full", "true"): Detector(d=0.0025, l=2.8e-5, h=0.022),
    ("full", "estimated"): Detector(d=0.0025, l=3.5e-5, h=0.018),
    ("simplified", "true"): Detector(d=0.0025, l=3e-5, h=0.0175),
    ("simplified", "estimated"): Detector(d=0.0025, l=4e-5, h=0.030),
}  # fmt: skip
"""Of the thesis's sum [rad/s]."""
THESIS_ALARMS = {
    "full": "1.7 % false (0 to 4), 3.5 % missed (0 to 16), 219 s; true 14 %, 17 %, 304 s",
    "simplified": "0.9 % false (0 to 3), 6.7 % missed (0 to 19), 272 s; true 10 %, 19 %, 271 s",
}


def damped(term: str, factor: float) -> Hull:
    """Another coefficient in yaw."""
    yaw = {**SHIP.coefficients["r"], term: factor * SHIP.coefficients["r"][term]}
    return replace(SHIP, coefficients={**SHIP.coefficients, "r": yaw})


def noise_study(runs: int) -> None:
    """Bias and spread of every parameter."""
    data = measured(harbour(seed=1), count=runs, seed=0, every=EVERY)
    found = {name: estimate_yaw(YAW_MODELS[name], data, YAW_TRUE) for name in ("full", "simplified")}
    exact = measured(harbour(seed=1), count=1, seed=0, noise=0.0, every=EVERY)
    without = {name: estimate_yaw(YAW_MODELS[name], exact, YAW_TRUE) for name in found}
    print(f"{runs} voyages of the nominal ship, in per cent of the true value:\n")
    print("| parameter | full: bias | spread | simplified: bias | spread | bias without noise |")
    print("|---|---|---|---|---|---|")
    for name in YAW_MODELS["full"].parameters:
        cells = [name]
        for structure in ("full", "simplified"):
            if name in YAW_MODELS[structure].parameters:
                error = 100.0 * (found[structure].of(name) / YAW_TRUE[name] - 1.0)
                cells += [f"{error.mean():+.1f}", f"{error.std():.1f}"]
            else:
                cells += ["", ""]
        simple = YAW_MODELS["simplified"].parameters
        cells.append(
            f"{100.0 * (without['simplified'].of(name)[0] / YAW_TRUE[name] - 1.0):+.1f}" if name in simple else ""
        )
        print(f"| {' | '.join(cells)} |")


def change_study(runs: int, structures: Sequence[str]) -> dict[str, float]:
    """What changes of the ship do to every estimate; returns the shares of voyages in which each shows."""
    changes = {
        "nothing": SHIP, "moment of inertia + 10 %": heavier(inertia=1.1),
        "moment of inertia + 20 %": heavier(inertia=1.2), "mass + 10 %": heavier(mass=1.1),
        "mass + 40 %": heavier(mass=1.4), "N_rr + 20 %": damped("r|r|", 1.2), "N_rv + 20 %": damped("r|v|", 1.2),
        "N_uv + 20 %": damped("|u|v", 1.2),
    }  # fmt: skip
    print("\nShift of the mean estimate, in standard deviations of one, and share of voyages in which the estimate is")
    print("outside what nominal voyages give in 95 % of cases:\n")
    shares = {}
    for structure in structures:
        model = YAW_MODELS[structure]
        before = estimate_yaw(model, measured(harbour(seed=1), count=runs, seed=0, every=EVERY), YAW_TRUE).parameters
        reach = float(scipy.stats.t.ppf(0.975, runs - 1)) * np.sqrt(1.0 + 1.0 / runs) * before.std(axis=0, ddof=1)
        low, high = before.mean(axis=0) - reach, before.mean(axis=0) + reach
        print(f"| {structure}: change | {' | '.join(model.parameters)} |")
        print("|---" * (1 + len(model.parameters)) + "|")
        for name, hull in changes.items():
            data = measured(harbour(hull, seed=1), count=runs, seed=1, every=EVERY)
            after = estimate_yaw(model, data, YAW_TRUE).parameters
            spread = np.hypot(before.std(axis=0), after.std(axis=0)) / np.sqrt(2.0)
            shift = (after.mean(axis=0) - before.mean(axis=0)) / spread
            seen = ((after < low) | (after > high)).mean(axis=0)
            shares |= {f"{structure}, {name}, {key}": float(x) for key, x in zip(model.parameters, seen, strict=True)}
            cells = [f"{value:+.1f}, {share:.0%}" for value, share in zip(shift, seen, strict=True)]
            print(f"| {name} | {' | '.join(cells)} |", flush=True)
        print()
    return shares


def instrument_study(runs: int) -> None:
    """Bias of output error and of instruments, which are beyond the thesis, and how often 95 % intervals hold."""
    voyage = harbour(seed=1, step_s=0.5)
    data = measured(voyage, count=runs, seed=7, noise=5.0**-0.5, averaged=1)
    quiet = estimate_yaw(FULL, exact(voyage), YAW_TRUE)
    rows = {
        "output error": estimate_yaw(FULL, data, YAW_TRUE),
        "instruments": estimate_yaw_by_instruments(FULL, data, YAW_TRUE),
    }
    print(
        f"{runs} voyages of 600 s at 2 Hz: bias ± its standard error, spread, and share of 95 % intervals that hold:\n"
    )
    print("| parameter | " + " | ".join(f"{name}: bias | spread | holds" for name in rows) + " |")
    print("|---" * (1 + 3 * len(rows)) + "|")
    for place, name in enumerate(FULL.parameters):
        cells, true = [], quiet.of(name)[0]
        for found in rows.values():
            kept = np.isfinite(found.fit)
            error = 100.0 * (found.of(name)[kept] / true - 1.0)
            holds = np.abs(found.of(name)[kept] - true) < 1.96 * found.std[kept, place]
            standard = error.std(ddof=1) / np.sqrt(len(error))
            cells += [f"{error.mean():+.1f} ± {standard:.1f} %", f"{error.std(ddof=1):.1f} %", f"{holds.mean():.0%}"]
        print(f"| {name} | {' | '.join(cells)} |")
    print(
        f"\nEstimates by instruments that did not settle: {int(np.isnan(rows['instruments'].fit).sum())}.\n", flush=True
    )


def alarm_study(runs: int, orders: Sequence[str]) -> dict[tuple[str, ...], tuple[float, ...]]:
    """The sum of the thesis: false and missed alarms with its constants, and with constants for 2 % of false ones."""
    found = {}
    print("The sum's alarms, 10 % more moment of inertia: per cent of voyages and mean time; estimated priors: mean of")
    print(f"{PRIORS} and their range. Rates of the thesis, of ten estimated priors and of the true one:")
    print("; ".join(f"{name}: {rates}" for name, rates in THESIS_ALARMS.items()) + "\n")
    print("| orders | mean of | model | prior | false | missed | time | at 2 % false: missed | time |")
    print("|---|---|---|---|---|---|---|---|---|")
    for words in orders:
        how = EXCITATIONS[words]
        nominal, heavy = (fleet(hull, how, count=runs, seed=0) for hull in (SHIP, heavier(inertia=1.1)))
        learnt = fleet(SHIP, how, count=PRIORS, seed=9000)
        apart = np.concatenate([b.column("r") - a.column("r") for a, b in zip(nominal, heavy, strict=True)])
        found[words,] = (float(np.sqrt((apart**2).mean())),)
        for averaged in (5, 7):
            voyages = [measured_fleet(own, seed=s, averaged=averaged) for own, s in ((nominal, 3000), (heavy, 4000))]
            data = measured_fleet(learnt, seed=5000, averaged=averaged, every=EVERY)
            for structure in ("full", "simplified"):
                model = YAW_MODELS[structure]
                true = np.array([YAW_TRUE[name] for name in model.parameters])
                for prior, values in (
                    ("true", true[None]),
                    ("estimated", estimate_yaw(model, data, YAW_TRUE).parameters),
                ):
                    rows = np.array([_alarms(model, theta, voyages, CONSTANTS[structure, prior]) for theta in values])
                    false, missed = rows[:, :2].mean(axis=0).tolist()
                    found[words, str(averaged), structure, prior] = (false, missed, _mean(rows[:, 2]))
                    print(f"| {words} | {averaged} | {structure} | {prior} | {_cells(rows)} |", flush=True)
    for words in orders:
        rms = found[words,][0]
        print(f"\nWith {words} orders the heavier ship's yaw rate differs by {rms:.5f} rad/s, root mean square.")
    return found


def _mean(values: np.ndarray) -> float:
    """Of those that are known."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _cells(rows: np.ndarray) -> str:
    """Mean and range of false, missed, time; missed and time at a rate."""
    cells = []
    for place, column in enumerate(rows.T):
        known = column[np.isfinite(column)]
        scale, unit = (1.0, " s") if place in (2, 4) else (100.0, " %")
        spread = f" ({scale * known.min():.0f} to {scale * known.max():.0f})" if len(known) > 1 else ""
        cells.append(f"{scale * known.mean():.0f}{unit}{spread}" if len(known) else "none")
    return " | ".join(cells)


def _alarms(model: YawModel, theta: np.ndarray, voyages: list[YawData], constants: Detector) -> tuple[float, ...]:
    nominal, heavy = (data.r - simulate_yaw(model, data, theta)[0] for data in voyages)
    rows: list[float] = []
    for detector in (constants, Detector.calibrated(nominal, false_share=0.02, deviations=1.0)):
        false, found = (alarm_samples(detector, residual) for residual in (nominal, heavy))
        seconds = STEP_S * float(np.nanmean(found)) if np.isfinite(found).any() else float("nan")
        rows += [float(np.isfinite(false).mean()), float(np.isnan(found).mean()), seconds]
    return (*rows[:3], *rows[4:])


def claims(shares: dict[str, float], alarms: dict[tuple[str, ...], tuple[float, ...]]) -> None:
    """What the thesis says, our number, where it is checked, and what cannot be."""
    brisk, true = (alarms["brisk", "7", "full", prior] for prior in ("estimated", "true"))
    simple = ", ".join(
        f"{name} {shares[f'simplified, mass + 40 %, {name}']:.0%}" for name in YAW_MODELS["simplified"].parameters
    )
    mass = ", ".join(f"{name} {shares[f'full, mass + 40 %, {name}']:.0%}" for name in ("M_v", "A"))
    inertia, less = (
        shares[f"{model}, moment of inertia + {size} %, I_r"] for model, size in (("full", 20), ("simplified", 10))
    )
    rows = (
        *manoeuvre_claims(),
        ("inertia is known best, roll worst", "first table above", MEETS),
        ("fewer parameters: more bias, less spread; bias without noise", "first table above", MEETS),
        ("full: inertia + 20 % is seen, mass + 40 % is not; only what changed moves",
         f"I_r seen in {inertia:.0%} of voyages; mass + 40 % by {mass}", MEETS),
        ("simplified: inertia + 10 % is seen", f"I_r seen in {less:.0%}", MEETS),
        ("simplified: mass moves every parameter", f"mass + 40 % seen by {simple}", "this table"),
        ("estimates are nearly normal", f"p = {normal_p():.2f} of a test on I_r", "this table"),
        ("sum: + 10 % inertia in 500 s, 1.7 % false, 3.5 % missed, 219 s (full, estimated priors)",
         f"brisk orders, mean of 7: {brisk[0]:.1%}, {brisk[1]:.1%}, {brisk[2]:.0f} s", WATCHED),
        ("the true prior misses more than estimated ones, 17 % to 3.5 %", f"{true[1]:.0%} to {brisk[1]:.0%}",
         "this table"),
        ("two real voyages: fits of 30 to 41 %, parameters of their halves", "not checked: the data are not published",
         "nothing"),
        ("pods fitted to a maker's table", "not checked: the table is not published", "nothing"),
        ("the exact rates of the sum", "not checked: excitation and anti-alias filter are not given", "nothing"),
    )  # fmt: skip
    print("\nWhat the thesis says, and what is found here (tests begin with tests/test_monitoring_yaw_models_):\n")
    print("| claim | here | checked by |")
    print("|---|---|---|")
    for row in rows:
        print(f"| {' | '.join(row)} |")


def manoeuvre_claims() -> tuple[tuple[str, str, str], ...]:
    """Those on single manoeuvres."""
    turned, rotated, light, more = turn(), rotation(), heavier(inertia=0.8), heavier(inertia=1.1)
    angles = np.rad2deg(np.linspace(0.0, np.pi / 2, 901))
    peaks = [angles[pod_force(Pods(), flow, np.deg2rad(angles), 60.0)[1].argmax()] for flow in (0.0, 5.0, 10.0)]
    orders = []
    for voyage, first in ((turned, 500), (rotated, 100)):
        budget = {name: np.abs(m[0, first:]).mean() for name, m in term_budget(FULL, exact(voyage), YAW_TRUE).items()}
        orders.append(sorted(budget, key=budget.__getitem__)[::-1])
    apart = [
        np.rad2deg(np.abs(changed.column("r") - whole.column("r")).max())
        for changed, whole in ((turn(light), turned), (rotation(light), rotated))
    ]
    farther = np.rad2deg(turn(more).column("psi")[-1] - turned.column("psi")[-1])
    data = measured(harbour(seed=1), count=1, seed=0, every=EVERY)
    one = estimate_yaw(FULL, data, YAW_TRUE).parameters
    scaled = replace(data, moment=1.25 * data.moment)
    law = estimate_yaw(FULL, scaled, {name: 1.25 * value for name, value in YAW_TRUE.items()}).parameters / one / 1.25
    ranks = [excitation_rank(YAW_MODELS["separate"], exact(v), YAW_TRUE) for v in (turned, rotation(ahead=2.0))]
    differ = [halves_of(voyage) for voyage in (turned, harbour(seconds=800.0, seed=5))]
    return (
        ("8.6 m/s 50 s after full ahead", f"{turned.column('u')[500]:.2f} m/s", MEETS),
        ("pods push most across at 90 degrees at rest, towards 45 at speed",
         f"{peaks[0]:.0f}, {peaks[1]:.0f}, {peaks[2]:.0f} degrees at 0, 5, 10 m/s", MEETS),
        ("turn: most by abs(u) r, abs(u) v, r abs(v), u r; least by dv/dt and roll at speed",
         f"most {', '.join(orders[0][:3])} (A is abs(u) r and u r); least {', '.join(orders[0][-2:])}", MEETS),
        ("on the spot: most by r abs(v) and r abs(r), roll negligible", f"most {', '.join(orders[1][:2])}", MEETS),
        ("inertia - 20 % shows on the spot rather than in a turn",
         f"yaw rate apart by {apart[1]:.2f} and {apart[0]:.3f} degrees/s at most", MEETS),
        ("a ship with more inertia turns as far or farther", f"{farther:+.3f} degrees for + 10 %", MEETS),
        ("a wrong scale of the moment multiplies every estimate alike",
         f"relative deviation {np.abs(law - 1.0).max():.0e} at most", MEETS),
        ("halves of a poor voyage differ at equal fit; a single step tells little",
         f"a turn: {differ[0]}; harbour: {differ[1]}", f"{MEETS}, {WATCHED}"),
        ("damping and Coriolis moment are one unless u changes sign",
         f"rank {ranks[0]} of 7 ahead, {ranks[1]} of 7 ahead and astern", MEETS),
    )  # fmt: skip


def halves_of(voyage: Voyage) -> str:
    """How the estimates of its halves differ."""
    data = measured(voyage, count=1, seed=6, every=EVERY)
    half = data.r.shape[1] // 2
    first, second = (estimate_yaw(FULL, data.part(part), YAW_TRUE) for part in (slice(0, half), slice(half, None)))
    count = int(halves_differ(first, second)[0].sum())
    return f"{count} of 9 by more than a factor of 3, fits {first.fit[0]:.0f} and {second.fit[0]:.0f} %"


def normal_p() -> float:
    """Of the Shapiro-Wilk test of the estimates of inertia."""
    data = measured(harbour(seed=1), count=100, seed=50, every=EVERY)
    return float(scipy.stats.shapiro(estimate_yaw(FULL, data, YAW_TRUE).of("I_r")).pvalue)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--study", choices=("all", "noise", "changes", "instruments", "alarms"), default="all")
    parser.add_argument("--orders", choices=("calm", "brisk"), nargs="+", default=("calm", "brisk"))
    parser.add_argument("--models", choices=("full", "simplified"), nargs="+", default=("full", "simplified"))
    asked = parser.parse_args()
    if asked.study in ("all", "noise"):
        noise_study(asked.runs)
    shares = change_study(asked.runs, asked.models) if asked.study in ("all", "changes") else {}
    if asked.study in ("all", "instruments"):
        instrument_study(asked.runs)
    alarms = alarm_study(asked.runs, asked.orders) if asked.study in ("all", "alarms") else {}
    if asked.study == "all" and "brisk" in asked.orders and len(asked.models) == 2:
        claims(shares, alarms)
