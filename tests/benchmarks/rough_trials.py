"""Step and roll trials in weather, by simulations that are not the project's: how often it is right what is said.

`python tests/benchmarks/rough_trials.py STUDY [--seeds N] [--seed FIRST] [--only CASE]`, a row for each case:

steps: shares of 95 % intervals that hold, in gusts and in a current; hysteresis found; holds astern; halves.
holds: at 1 Hz, shares of trials with a model when held for as long as there is, and as is said to do.
watch: shares of 95 % intervals that hold while a trial is sailed, in calm water, waves and gusts.
roll: loads inside their intervals, and trusted, in calm water, waves, with other damping, and sensors out of place.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from expdesign.errors import ExpdesignError
from expdesign.step_trials import StepTrial, controls_of, identify_steps
from live_case import errors_of_watched
from plain_craft import CONSTANTS_S, RATE_PER_RAD, ROUND, Craft, record, steady_speed
from plain_roller import Sea, deviations, estimated, height_deviations

LEVELS = tuple((n, a) for a in (0.15, 0.3) for n in (4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 12.0, 10.0, 8.0, 6.0, 4.0))
ASTERN = ((4.0, 0.2), (-4.0, 0.2), (-7.0, 0.2), (-4.0, 0.2), (4.0, 0.2))
COVERED = {"calm": Craft(), "gusts": Craft(gusts_mps=0.08), "current of 0.3 m/s": Craft(current_mps=0.3, hold_s=80.0)}
WATCHED = {"calm": Craft(waves_mps=0.0), "waves": Craft(), "gusts": Craft(gusts_mps=0.08)}
SEAS = {
    "calm": Sea(),
    "calm, rudder by the clock, damping 8 % by the square": Sea(zigzag_s=12.0, quadratic=0.08),
    "calm, damping by the square half of the linear one": Sea(quadratic=0.5),
    "waves, roll of 1 degree": Sea(roll_deg=1.0),
    "waves of the roll period, roll of 1 degree": Sea(roll_deg=1.0, wave_s=7.5),
    "waves, roll of 1 degree, rudder by the clock, damping 8 % by the square": Sea(
        roll_deg=1.0, zigzag_s=12.0, quadratic=0.08
    ),
    "waves, roll of 1 degree, sensor 2 m before midships, tilted by 2 degrees": Sea(
        roll_deg=1.0, forward_m=2.0, tilt_deg=2.0
    ),
    "sensor 3 m before midships": Sea(forward_m=3.0),
    "tilt of 2 degrees, 2 m before, damping 20 % by the square": Sea(quadratic=0.2, forward_m=2.0, tilt_deg=2.0),
}


def _identified(seed: int, craft: Craft) -> StepTrial:
    return identify_steps(record(seed, craft), controls_of(("n1", "rudder1")))


def _covered(seeds: range, craft: Craft) -> str:
    found: dict[str, list[bool]] = {"U": [], "r": [], "T": [], "dead time": []}
    for seed in seeds:
        trial = _identified(seed, craft)
        found["dead time"] += [abs(value - craft.delay_s) < 1.96 * std for value, std in trial.delays]
        for one in trial.samples:
            if one.plateau is None:
                continue
            n, rudder = one.hold.commands
            apart = one.plateau.state - [
                float(steady_speed(np.array(n), np.array(rudder), craft)),
                RATE_PER_RAD * rudder,
            ]
            for name, z in zip("Ur", apart / one.plateau.std, strict=True):
                found[name].append(abs(z) < 1.96)
            if one.counts and one.response is not None:
                channel = one.hold.channel or 0
                std = np.hypot(one.response.time_constant_std_s, trial.delays[channel][1])
                found["T"].append(abs(one.response.time_constant_s - CONSTANTS_S[channel]) < 1.96 * std)
    return ", ".join(f"{name} {100 * np.mean(hits):.0f} % of {len(hits)}" for name, hits in found.items())


def _hysteresis(seeds: range, craft: Craft) -> str:
    found = 0
    for seed in seeds:
        said = [one for one in _identified(seed, craft).found if (one.kind, one.command) == ("hysteresis", "throttle")]
        found += any(one.p_value < 0.01 for one in said)
    return f"said in {found} of {len(seeds)}"


def _astern(seeds: range) -> str:
    """Whether a hold astern gives a steady state, and how far its speed is from that ahead of the same propeller."""
    silent, worst = 0, 0.0
    for seed in seeds:
        try:
            trial = _identified(seed, Craft(steps=ROUND + ASTERN))
        except ExpdesignError:
            continue
        states = [(one.plateau.state[0], one.hold.commands[0]) for one in trial.samples if one.plateau is not None]
        apart = [abs(speed - 0.4 * n) for speed, n in states if n < 0]
        silent, worst = silent + bool(apart), max([worst, *apart])
    return f"taken as steady ahead in {silent} of {len(seeds)}" + (f", up to {worst:.2f} m/s off" if silent else "")


def _half(seeds: range) -> str:
    found, errors = 0, []
    for seed in seeds:
        try:
            trial = _identified(seed, Craft(steps=ROUND[:7]))
        except ExpdesignError:
            continue
        found += 1
        damping = trial.model.damping[0]
        assert damping is not None
        errors += [damping.at(speed, 0.12) * 0.4 - speed for speed in (2.0, 3.0, 4.0)]
    rms = f", speeds within {np.sqrt(np.mean(np.square(errors))):.3f} m/s rms" if errors else ""
    return f"the speed's half in {found} of {len(seeds)}{rms}"


def steps(seeds: range) -> Iterator[tuple[str, str]]:
    """Rows of step trials."""
    for name, craft in COVERED.items():
        yield f"intervals, {name}", _covered(seeds, craft)
    yield "no hysteresis", _hysteresis(seeds, Craft(hump=True, steps=LEVELS))
    yield "planing 0.18 m/s off at one level", _hysteresis(seeds, Craft(hump=True, steps=LEVELS, planing_play_rps=0.17))
    yield "holds astern", _astern(seeds)
    yield "steps of the throttle alone", _half(seeds)


def holds(seeds: range) -> Iterator[tuple[str, str]]:
    """Rows of short holds at 1 Hz."""
    for hold_s in (12.0, 20.0, 40.0):
        first, then, lengths = 0, 0, []
        for seed in seeds:
            try:
                _identified(seed, Craft(step_s=1.0, hold_s=hold_s))
                first += 1
            except ExpdesignError as error:
                would = re.search(r"; (\d+) s or more would do", str(error))
                if would is None:
                    continue
                lengths.append(float(would[1]))
                trial = _identified(seed, Craft(step_s=1.0, hold_s=lengths[-1]))
                then += len(trial.model.halves) == 2
        said = (
            f"; {min(lengths):.0f} to {max(lengths):.0f} s said to do, which gives both halves in {then}"
            if lengths
            else ""
        )
        yield f"1 Hz, holds of {hold_s:g} s", f"a model in {first} of {len(seeds)}{said}"


def _watched(seeds: range, craft: Craft) -> str:
    """States of the steps that count."""
    errors = np.concatenate([errors_of_watched(seed, craft) for seed in seeds])
    (u, r), spread = 100 * np.mean(np.abs(errors) < 1.96, axis=0), np.sqrt(np.mean(np.square(errors), axis=0))
    steps = len(seeds) * (len(craft.steps) - 1)
    return f"{len(errors)} of {steps} count; inside U {u:.0f} %, r {r:.0f} %; rms {spread[0]:.2f}, {spread[1]:.2f} std"


def watch(seeds: range) -> Iterator[tuple[str, str]]:
    """Rows of trials that are watched while they are sailed."""
    for name, craft in WATCHED.items():
        yield f"watched, {name}", _watched(seeds, craft)


def roll(seeds: range, only: str = "") -> Iterator[tuple[str, str]]:
    """Rows of roll trials; intervals of two standard deviations where there is no profile."""
    for name, sea in SEAS.items():
        if not name.startswith(only):
            continue
        inside = trusted = answers = 0
        errors, others, heights = [], [], []
        for seed in seeds:
            one = estimated(seed, sea)
            value, std = one.values["m"], one.std["m"]
            low, high = one.load_interval or (value - 1.96 * std, value + 1.96 * std)
            trusted += one.trusted
            answers += one.answering
            if not one.trusted:
                continue
            inside += low <= sea.load[0] <= high
            errors.append(value - sea.load[0])
            others.append(np.mean(np.abs(deviations(one)) < 1.96))
            heights.append(np.mean(np.abs(height_deviations(one, sea)) < 1.96))
        rms = f", error {np.sqrt(np.mean(np.square(errors))):.0f} kg rms" if errors else ""
        if others:
            rms += f"; inside 95 %: other parameters {_share(others)}, metacentric heights {_share(heights)}"
        said = f"rudder said to answer in {answers}"
        yield name, f"trusted {trusted} of {len(seeds)}, load inside in {inside}{rms}; {said}"


def _share(trials: list[float]) -> str:
    """Mean of shares of trials, and its standard error between these: errors of one trial go together."""
    return f"{np.mean(trials):.0%} ± {np.std(trials, ddof=1) / np.sqrt(len(trials)):.0%}"


STUDIES = {"steps": steps, "holds": holds, "watch": watch, "roll": roll}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", choices=STUDIES)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="the first of them")
    parser.add_argument("--only", default="", help="beginning of the names of cases of roll")
    asked = parser.parse_args()
    print("| case | found | processor s |\n|---|---|---|")
    begun = time.process_time()
    several = range(asked.seed, asked.seed + asked.seeds)
    rows = roll(several, asked.only) if asked.study == "roll" else STUDIES[asked.study](several)
    for case, text in rows:
        print(f"| {case} | {text} | {time.process_time() - begun:.0f} |", flush=True)
        begun = time.process_time()
