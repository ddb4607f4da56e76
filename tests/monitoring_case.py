"""Stretches with known statistics, and a tender in operation, for the tests of monitoring."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.export.monitor_content import Moment, MonitorContent
from expdesign.monitoring import KINDS, Alarm, Calibration, Change, Grams, Rules, State, Step, watch
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Commands, Record
from expdesign.simulation import Environment, Variation, draw_weather, measure, simulate
from expdesign.vessel import Vessel, column_name

ROOT = Path(__file__).parents[1]
TENDER = ROOT / "scenarios" / "vessels" / "tender-20m.toml"
CHANGES, STARTS, FORCES = 4, 3, 2
STRETCH_S = 60.0


def drawn_grams(
    count: int, *, seed: int, change: np.ndarray | None = None, since: int = 0, quick: float = 0.3, slow: float = 0.3
) -> Grams:
    """Stretches of 20 samples of one channel with random sensitivities, a varying force, and perhaps a change."""
    return grams_from(drawn_columns(count, seed=seed, change=change, since=since, quick=quick, slow=slow))


def drawn_columns(
    count: int, *, seed: int, change: np.ndarray | None = None, since: int = 0, quick: float = 0.3, slow: float = 0.3
) -> np.ndarray:
    """(count, samples, columns) X, S, F and e."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((count, 20, CHANGES + STARTS + FORCES + 1))
    columns[:, :, 1] = 0.9 * columns[:, :, 0] + 0.3 * columns[:, :, 1]  # two changes that are alike
    force = np.zeros((count, FORCES))
    for std, time_s in ((quick, 300.0), (slow, 43200.0)):
        keep = np.exp(-STRETCH_S / time_s)
        part = std * rng.standard_normal(FORCES)
        for index in range(count):
            force[index] += part
            part = keep * part + std * np.sqrt(1.0 - keep**2) * rng.standard_normal(FORCES)
    starts = columns[:, :, CHANGES : CHANGES + STARTS] @ rng.standard_normal((count, STARTS, 1))
    pushed = columns[:, :, CHANGES + STARTS : -1] @ force[:, :, None]
    error = (starts + pushed)[:, :, 0] + rng.standard_normal((count, 20))
    if change is not None:
        error[since:] += columns[since:, :, :CHANGES] @ change
    columns[:, :, -1] = error
    return columns


def grams_from(columns: np.ndarray) -> Grams:
    """Inner products of columns, all of the first channel."""
    count, samples, width = columns.shape
    products = np.zeros((4, count, width, width))
    products[0] = np.swapaxes(columns, 1, 2) @ columns
    counts = np.zeros((4, count))
    counts[0] = samples
    return Grams(
        time_s=STRETCH_S * np.arange(count), duration_s=np.full(count, STRETCH_S), products=products,
        counts=counts, budget=np.ones((count, CHANGES, 3)),
        kind=np.arange(count) % len(KINDS), stretch_s=STRETCH_S,
    )  # fmt: skip


def tender(**factors: float) -> Vessel:
    """The tender with some parameters times a factor."""
    vessel = load_vessel(TENDER)
    known = dict(zip(vessel.model.names, vessel.model.parameters.tolist(), strict=True))
    changed = {name: factor * known[name] for name, factor in factors.items()}
    return replace(vessel, model=vessel.model.with_parameters(changed))


def orders(samples: int, rng: np.random.Generator) -> np.ndarray:
    """(k, 4) of a voyage: speeds held for minutes, turns now and then."""
    table, row = np.zeros((samples, 4)), 0
    while row < samples:
        held, speed = int(rng.uniform(60, 400)), rng.uniform(4, 10)
        angle = rng.choice([-1, 0, 1]) * rng.uniform(0.05, 0.5)
        table[row : row + held] = speed, angle, speed, -angle
        row += held
    return table


def voyage(
    vessel: Vessel, samples: int, *, seed: int, stronger: float = 1.0, since: int = 0, swell_mps: float = 0.0
) -> dict[str, np.ndarray]:
    """Measured columns of a voyage in a current that wanders about a mean of its own.

    Args:
        vessel: the ship.
        samples: of one second.
        seed: of everything drawn.
        stronger: factor on the current and its wandering.
        since: sample from which this factor holds; before, the current is that of the reference.
        swell_mps: amplitude of sway in a swell of 8 s, in which yaw goes with a tenth of it in rad/s [m/s].
    """
    rng = np.random.default_rng(seed)
    weather = Environment(
        current_to=0.1 * rng.standard_normal(2), current_variation=Variation(std_mps=0.03, correlation_s=300.0)
    )
    commands = Commands(sample_time_s=1.0, names=vessel.model.inputs, values=orders(samples, rng))
    series = draw_weather(weather, samples, sample_time_s=1.0, rng=rng)
    factor = np.where(np.arange(samples) < since, 1.0, stronger)
    series = replace(series, current_to=factor[:, None] * series.current_to)
    track = simulate(vessel, commands, velocity=(3.0, 0.0, 0.0), environment=series)
    told = dict(measure(vessel, commands, track, environment=series, rng=rng))
    phase = 2.0 * np.pi * told["time_s"] / 8.0
    told["v_mps"] = told["v_mps"] + swell_mps * np.sin(phase)
    told["r_radps"] = told["r_radps"] + 0.1 * swell_mps * np.cos(phase)
    return told


def voyage_csv(path: Path, vessel: Vessel, samples: int, *, seed: int, begin_s: float = 0.0) -> Path:
    """The same as a file, without wind."""
    told = voyage(vessel, samples, seed=seed)
    told["time_s"] = told["time_s"] + begin_s
    kept = [name for name in told if not name.startswith("wind")]
    table = np.column_stack([told[name] for name in kept])
    np.savetxt(path, table, delimiter=",", header=",".join(kept), comments="", fmt="%.9g")
    return path


def voyage_record(
    vessel: Vessel, samples: int, *, seed: int, stronger: float = 1.0, since: int = 0, swell_mps: float = 0.0
) -> Record:
    """The same as a record of one batch."""
    told = voyage(vessel, samples, seed=seed, stronger=stronger, since=since, swell_mps=swell_mps)
    batch = Batch(
        name="voyage",
        sample_time_s=1.0,
        input_names=vessel.model.inputs,
        inputs=np.column_stack([told[column_name(name)] for name in vessel.model.inputs]),
        velocity=np.column_stack([told["u_mps"], told["v_mps"], told["r_radps"]]),
        pose=np.column_stack([told["north_m"], told["east_m"], np.unwrap(told["heading_rad"])]),
    )
    return Record(batches=(batch,), notes=())


def watched(
    calibration: Calibration, grams: Grams, limit: float, state: State | None = None, *, port_s: float = np.inf
) -> tuple[State, tuple[Alarm, ...], tuple[Step, ...]]:
    """All stretches, the error of the changed ship being linear in its changes."""
    state = State.begun(calibration, time_s=0.0) if state is None else state
    alarms, steps, first = list[Alarm](), list[Step](), 0
    while first < len(grams):
        rest = grams.part(slice(first, None))
        after = np.eye(rest.products.shape[-1])
        after[:CHANGES, -1] = -state.shift
        linearised = replace(rest, products=after.T @ rest.products @ after)
        state, more, sums, used = watch(calibration, state, linearised, rules=Rules(limit=limit, port_s=port_s))
        alarms, steps, first = [*alarms, *more], [*steps, *sums], first + used
    return state, tuple(alarms), tuple(steps)


def content_of(calibration: Calibration, ends: tuple[State, tuple[Alarm, ...], tuple[Step, ...]], limit: float):
    """What is told of a watch."""
    state, alarms, steps = ends
    changes = tuple(
        Change(effect=f"theta:p{n}", size=0.1, unit=(0.01, "%"), words=f"parameter p{n}", whole=1.0)
        for n in range(CHANGES)
    )
    moments = [
        Moment(time_s=step.time_s, statistic=step.statistic, value=np.zeros(CHANGES), std=np.ones(CHANGES))
        for step in steps
        if step.compared
    ]
    return MonitorContent(
        vessel="drawn", changes=changes, calibration=calibration, reference_s=0.0, state=state, limit=limit,
        false_alarm_days=1.0, alarms=alarms, moments=tuple(moments), left_out_rows=0, unread_rows=0, notes=(),
        command="",
    )  # fmt: skip
