"""Records of step trials for the tests: single responses with known constants, and a simulated fast craft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy

from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Commands, Record
from expdesign.simulation import Environment, Variation, draw_weather, measure, simulate

ROOT = Path(__file__).parents[1]
TRUTH = ROOT / "scenarios" / "vessels" / "fast-8m-true.toml"
GUESS = ROOT / "scenarios" / "vessels" / "fast-8m.toml"
INPUTS = ("n1", "rudder1")
HOLD_S = 50.0
STEPS = (
    (4.0, 0.1), (8.0, 0.1), (12.0, 0.1), (16.0, 0.1), (20.0, 0.1), (16.0, 0.1), (12.0, 0.1), (8.0, 0.1),
    (8.0, 0.25), (8.0, 0.4), (8.0, 0.25), (8.0, 0.1), (8.0, -0.1), (8.0, -0.25),
    (12.0, -0.25), (12.0, -0.4), (12.0, -0.25), (12.0, 0.1), (12.0, 0.25), (16.0, 0.25), (16.0, 0.1), (16.0, -0.2),
)  # fmt: skip
"""Throttle [rps] and rudder [rad], up and down."""


def noise(
    rng: np.random.Generator, count: int, *, sample_time_s: float, std: float, correlation_s: float
) -> np.ndarray:
    """First-order autoregressive noise, settled."""
    keep = np.exp(-sample_time_s / correlation_s) if correlation_s else 0.0
    before = int(20 * correlation_s / sample_time_s) + 1
    white = rng.standard_normal(before + count) * np.sqrt(1.0 - keep**2)
    return std * scipy.signal.lfilter([1.0], [1.0, -keep], white)[-count:]


def craft_columns(
    seed: int,
    *,
    steps: Sequence[tuple[float, float]] = STEPS,
    hold_s: float = HOLD_S,
    waves_mps: float = 0.1,
    current_to: tuple[float, float] = (0.0, 0.0),
) -> dict[str, np.ndarray]:
    """The fast craft's steps, measured with noise in waves that move it about, and in a current to north and east."""
    truth, rng = load_vessel(TRUTH), np.random.default_rng(seed)
    samples = round(hold_s / truth.sample_time_s)
    commands = Commands(
        sample_time_s=truth.sample_time_s, names=INPUTS, values=np.repeat(np.array(steps), samples, axis=0)
    )
    waves = Variation(std_mps=waves_mps, correlation_s=1.0)
    sea = Environment(current_to=np.array(current_to), current_variation=waves)
    met = draw_weather(sea, len(commands), sample_time_s=commands.sample_time_s, rng=rng)
    sailed = simulate(truth, commands, velocity=(1.5, 0.0, 0.05), environment=met)
    return measure(truth, commands, sailed, environment=met, rng=rng)


def craft_record(seed: int, *, with_sway: bool = False, current_to: tuple[float, float] = (0.0, 0.0)) -> Record:
    """The same as a record, headings unknown."""
    columns = craft_columns(seed, current_to=current_to)
    sway = columns["v_mps"] if with_sway else np.full_like(columns["v_mps"], np.nan)
    batch = Batch(
        name="steps", sample_time_s=0.2, input_names=INPUTS,
        inputs=np.stack([columns["n1_rps"], columns["rudder1_rad"]], axis=1),
        velocity=np.stack([columns["u_mps"], sway, columns["r_radps"]], axis=1),
    )  # fmt: skip
    return Record(batches=(batch,))


def write_csv(path: Path, columns: dict[str, np.ndarray], names: Sequence[str]) -> Path:
    """Some columns as a file of measured data."""
    rows = zip(*(columns[name].tolist() for name in names), strict=True)
    text = "\n".join([",".join(names), *(",".join(f"{value:.8g}" for value in row) for row in rows)])
    path.write_text(text + "\n", encoding="utf-8")
    return path


def mirrored(record: Record) -> Record:
    """The same trial with port and starboard exchanged."""
    signs = np.array([1.0, -1.0])
    return Record(
        batches=tuple(
            replace(batch, inputs=batch.inputs * signs, velocity=batch.velocity * [1.0, -1.0, -1.0])
            for batch in record.batches
        )
    )
