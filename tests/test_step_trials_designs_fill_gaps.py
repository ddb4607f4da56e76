"""Levels even in steady speed, and a second trial between the levels of a first, predict better between far levels.

The thrust of the craft grows with the third power of its order, so that equal steps of the order leave a gap below the
highest speed. Designs compared have as many levels held for as long, and the same noise. Cross-validation cannot see
the gap of the equal steps, in which it holds nothing out: errors are those against the truth there.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from design_case import spec
from expdesign.dictionary import build_primitive
from expdesign.scenario import load_vessel
from expdesign.simulation import simulate
from expdesign.step_trials.surfaces import Sampled, ridge
from expdesign.vessel import Vessel
from expdesign.vessel.structures import Term
from step_case import GUESS

STEPS, TOP_MPS, SEEDS, NOISE_MPS = 5, 8.0, 200, 0.05
DRAG, FULL_RPS = 0.2, 20.0
THRUST = DRAG * TOP_MPS / FULL_RPS**3


@cache
def craft() -> Vessel:
    """The fast craft with linear drag and a thrust of the third power of its propeller speed."""
    ship = load_vessel(GUESS)
    model, given = ship.model, {"X_u": -DRAG, "X_abs_u_u": 0.0, "X_vr": 0.0, "X_nn": THRUST}
    terms = tuple(
        Term(term.equation, term.name, "abs(n1)*abs(n1)*n1") if term.name == "X_nn" else term for term in model.terms
    )
    values = np.array([given.get(name, value) for name, value in zip(model.names, model.parameters, strict=True)])
    known = replace(model, terms=terms, parameters=values, parameter_std=np.zeros(len(values)), parameter_range={})
    return replace(ship, model=known)


@cache
def steady(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Steady speeds [m/s] and orders, as shares of full ahead, at the end of each level of a simulated staircase."""
    shift = 0.5 if kind.endswith("shifted") else 0.0
    least = 1.0
    request = spec(
        "throttle_steps", speed_mps=least, rise=TOP_MPS / least, steps=STEPS, shift=shift, duration_s=60.0 * 11
    )
    run = build_primitive(craft(), request)
    count = 2 * len(np.arange(STEPS + (0 if shift else 1))) - 1
    ends = np.linspace(0, len(run.commands), count + 1).round().astype(int)[1:]
    if kind.startswith("equal"):
        lowest = (DRAG * least / THRUST) ** (1 / 3)
        up = np.linspace(lowest, FULL_RPS, STEPS + 1) + shift * (FULL_RPS - lowest) / STEPS
        orders = up[up <= FULL_RPS + 1e-9]
        place = np.minimum(np.arange(len(run.commands)) * count // len(run.commands), count - 1)
        values = run.commands.values.copy()
        values[:, 0] = np.concatenate([orders, orders[-2::-1]])[place]
        run = replace(
            run,
            commands=replace(run.commands, values=values),
            trajectory=simulate(craft(), replace(run.commands, values=values), velocity=run.entry_velocity),
        )
    return run.trajectory.velocity[ends, 0], run.commands.values[ends - 1, 0] / FULL_RPS


def gap_errors(*kinds: str) -> np.ndarray:
    """(seeds,) root mean square error of the damping of surge in the gap that equal steps of the order leave."""
    speeds, orders = (np.concatenate(parts) for parts in zip(*(steady(kind) for kind in kinds), strict=True))
    levels = np.unique(steady("equal")[0].round(2))
    inside = np.linspace(levels[-2], levels[-1], 30)[1:-1]
    truth = (DRAG * inside / THRUST) ** (1 / 3) / FULL_RPS
    errors = []
    for seed in range(SEEDS):
        noisy = speeds + NOISE_MPS * np.random.default_rng(seed).standard_normal(len(speeds))
        powers = np.arange(5)
        fit = ridge(
            Sampled(
                columns=noisy[:, None] ** powers,
                values=orders,
                weights=np.ones(len(orders)),
                penalised=np.minimum(powers, 1).astype(float),
            )
        )
        errors.append(np.sqrt(np.mean((inside[:, None] ** powers @ fit.coefficients - truth) ** 2)))
    return np.array(errors)


def better(one: np.ndarray, other: np.ndarray) -> float:
    """Share of seeds in which the first errs less, less two of its standard errors."""
    share = float(np.mean(one < other))
    return share - 2 * np.sqrt(max(share * (1 - share), 1 / SEEDS) / SEEDS)


def test_equal_steps_of_the_order_leave_a_gap_in_speed_that_inverse_mapped_levels_do_not() -> None:
    apart = [np.diff(np.unique(steady(kind)[0].round(2))).max() for kind in ("equal", "even")]
    assert apart[0] > 1.5 * apart[1]


def test_levels_even_in_speed_predict_better_in_the_gap() -> None:
    even, equal = gap_errors("even"), gap_errors("equal")
    assert better(even, equal) > 0.5


def test_a_second_trial_shifted_by_half_a_step_predicts_better_in_the_gap_than_the_first_one_repeated() -> None:
    shifted, repeated = gap_errors("equal", "equal shifted"), gap_errors("equal", "equal")
    assert better(shifted, repeated) > 0.5
