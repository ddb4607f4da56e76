"""The manoeuvre that distinguishes two explanations: the extended models disagree most in it, per minute."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.conventions import rotated
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import Motion, simulate_windows
from expdesign.simulation.motion import to_body
from expdesign.values import Array
from expdesign.vessel import NUMPY, stem

HEADINGS = (0.0, np.pi / 2, np.pi, 3 * np.pi / 2)
ROUNDS = 2  # simulations until the heading is accurate enough; it depends on current and wind, which depend on it
PROPOSED = 240  # samples of a standard proposal


@dataclass(frozen=True, kw_only=True, eq=False)
class Proposal:
    """A manoeuvre that may distinguish causes."""

    name: str  # of the primitive
    inputs: Array  # (k, m) commands in the model's order
    velocity: Array  # (3,) to start with
    sample_time_s: float  # of the commands


def most_discriminating(
    one: ExtendedModel, others: Sequence[ExtendedModel], proposals: Sequence[Proposal], std: Array, like: Windows
) -> str | None:
    """Name of the proposal for which `one` and the nearest of the others disagree most per minute.

    That is on the first heading on which they disagree least: nobody knows beforehand which it will be.
    Proposals of the same length and sample time are simulated together.
    """
    best: tuple[float, str] | None = None
    wind = mean_measured_wind(like)
    lengths = [(len(proposal.inputs), proposal.sample_time_s) for proposal in proposals]
    for length in dict.fromkeys(lengths):
        alike = [proposal for proposal, own in zip(proposals, lengths, strict=True) if own == length]
        windows = _turning(one, _windows(alike, like, wind), alike, wind)
        first, *rest = (_by_proposal(_sailed(ship, windows, alike)) for ship in (one, *others))
        apart = np.min([np.sum(((first - other) / std) ** 2, axis=(2, 3)).min(axis=1) for other in rest], axis=0)
        for proposal, distance in zip(alike, apart / (length[0] * length[1] / 60), strict=True):
            if distance > (best[0] if best else 0.0):
                best = float(distance), proposal.name
    return best[1] if best else None


def _by_proposal(motion: Motion) -> Array:
    """(p, headings, s, 4) what sensors show of every proposal; nan where the simulation diverges."""
    of_each = (-1, len(HEADINGS))
    shown = motion.predicted.reshape(*of_each, *motion.predicted.shape[1:]).copy()
    shown[motion.diverged_windows.reshape(of_each).any(axis=1)] = np.nan
    return shown


def mean_measured_wind(like: Windows) -> Array | None:
    """(2,) mean velocity of the air to north and east in data that measure it [m/s]."""
    if not like.has_wind:
        return None
    return np.array([np.mean(part) for part in rotated(np.moveaxis(like.wind, -1, 0), like.heading)])


def _sailed(ship: ExtendedModel, windows: Windows, proposals: Sequence[Proposal]) -> Motion:
    start = np.zeros((len(windows.batch), ship.states))
    start[:, :3] = np.repeat([proposal.velocity for proposal in proposals], len(HEADINGS), axis=0)
    return simulate_windows(ship, windows, start)


def _turning(ship: ExtendedModel, windows: Windows, proposals: Sequence[Proposal], wind: Array | None) -> Windows:
    """The windows with the simulated heading, so that current and wind act from the right side."""
    for _ in range(ROUNDS):
        heading = _headings(proposals)[:, None] + _sailed(ship, windows, proposals).heading_change
        windows = replace(windows, heading=heading, wind=_air(wind, heading))
    return windows


def _headings(proposals: Sequence[Proposal]) -> Array:
    """(w,) every initial heading of every proposal."""
    return np.tile(HEADINGS, len(proposals))


def _air(wind: Array | None, heading: Array) -> Array:
    """(w, k, 2) a steady wind in the b-frame; none where it is not measured."""
    return np.zeros((*heading.shape, 2)) if wind is None else np.stack(to_body(wind, heading, NUMPY), axis=-1)


def _windows(proposals: Sequence[Proposal], like: Windows, wind: Array | None) -> Windows:
    """A window per proposal and initial heading, held constant, in the mean wind; proposals are alike in length."""
    sample_s = proposals[0].sample_time_s
    substeps = max(1, int(np.ceil(sample_s / like.step_s - 1e-9)))
    inputs = tuple(np.repeat(proposal.inputs, substeps, axis=0) for proposal in proposals)
    heading = np.repeat(_headings(proposals)[:, None], len(inputs[0]), axis=1)
    w, count = heading.shape
    return Windows(
        step_s=sample_s / substeps,
        steps_per_sample=substeps,
        batch=np.repeat(np.arange(float(len(proposals))), len(HEADINGS)),
        batch_inputs=inputs,
        first=np.zeros(w),
        measured=np.zeros((w, -(-count // substeps), 4)),
        heading=heading,
        wind=_air(wind, heading),
        depth_m=np.full((w, count), float(np.median(like.depth_m))),
        time_s=np.broadcast_to(1e9 + np.arange(count, dtype=float), (w, count)),
        has_heading=True,
        has_wind=wind is not None,
        has_depth=False,
        derived=like.derived,
        names=tuple(proposal.name for proposal in proposals),
    )


def standard_proposals(like: Windows, inputs: tuple[str, ...], sample_time_s: float) -> tuple[Proposal, ...]:
    """Manoeuvres of the standard families within the range of the recorded inputs, with equal numbers of samples."""
    rows = np.concatenate(like.batch_inputs)
    middle, low, high = np.median(rows, axis=0), np.quantile(rows, 0.05, axis=0), np.quantile(rows, 0.95, axis=0)
    velocity = np.nanmedian(like.measured[..., :3].reshape(-1, 3), axis=0)
    velocity = np.array([velocity[0], 0.0, 0.0])
    count = max(40, round(PROPOSED * like.sample_s / sample_time_s))
    time = np.arange(count) / count
    steering = [i for i, n in enumerate(inputs) if stem(n) in ("a", "rudder", "tau_psi", "tau_y")]
    driving = [i for i in range(len(inputs)) if i not in steering]
    rng = np.random.default_rng(0)
    shapes: Mapping[str, tuple[list[int], Array]] = {
        "zigzag": (steering, np.sign(np.sin(2 * np.pi * 4 * time))),
        "zigzag_long": (steering, np.sign(np.sin(2 * np.pi * 2 * time))),
        "turning_circle": (steering, np.ones(count)),
        "turning_circle_port": (steering, -np.ones(count)),
        "acceleration": (driving, np.where(time < 0.2, -1.0, 1.0)),
        "deceleration": (driving, np.where(time < 0.2, 1.0, -1.0)),
        "inward_spiral": (steering, time),
        "telegraph": ([*steering, *driving], np.repeat(rng.choice([-1.0, 1.0], 13), -(-count // 13))[:count]),
        "straight": ([], np.zeros(count)),
    }
    proposals = []
    for name, (which, shape) in shapes.items():
        commands = np.tile(middle, (count, 1))
        for index in which:
            span = np.where(shape > 0, high[index] - middle[index], middle[index] - low[index])
            commands[:, index] = middle[index] + shape * span
        if which or name == "straight":
            proposals.append(Proposal(name=name, inputs=commands, velocity=velocity, sample_time_s=sample_time_s))
    return tuple(proposals)
