"""Records with an effect hidden in them, and the models that know nothing of it, for the tests of the diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

import hidden_effects as sea
from expdesign.records import central_difference, smoothed_velocity
from expdesign.signals import Batch, Record
from expdesign.vessel import STRUCTURES, Actuator, Limit, Term, Vessel, VesselModel

COASTER_TERMS = {
    "X_u": ("u", "u"), "X_abs_u_u": ("u", "abs(u)*u"), "X_vr": ("u", "v*r"), "X_nn": ("u", "abs(n1)*n1"),
    "X_dd": ("u", "u*abs(u)*rudder1*rudder1"), "Y_v": ("v", "v"), "Y_ur": ("v", "u*r"),
    "Y_rud": ("v", "u*abs(u)*rudder1"), "N_r": ("r", "r"), "N_uv": ("r", "u*v"), "N_rud": ("r", "u*abs(u)*rudder1"),
}  # fmt: skip
FREE = Limit()


def vessel_of(
    ship: str, *, relative_std: float = 0.0, sample_time_s: float = 1.0, without: tuple[str, ...] = ()
) -> Vessel:
    """A ship of `hidden_effects` as the package knows it, with the generator's parameters, perhaps lacking terms."""
    if ship == "tug":
        terms = STRUCTURES["manoeuvring-18"]
        actuators = tuple(
            Actuator(kind="azimuth", number=i, forward_m=x, limits=(FREE, FREE)) for i, x in ((1, 9.0), (2, -9.0))
        )
    elif ship == "barge":
        terms, actuators = STRUCTURES["manoeuvring-10"], (Actuator(kind="force", number=1, limits=(FREE,) * 3),)
    else:
        terms = tuple(Term(equation, name, text) for name, (equation, text) in COASTER_TERMS.items())
        actuators = (
            Actuator(kind="propeller", number=1, forward_m=-20.0, limits=(FREE,)),
            Actuator(kind="rudder", number=1, forward_m=-25.0, limits=(FREE,)),
        )
    terms = tuple(term for term in terms if term.name not in without)
    values = np.array([sea.SHIPS[ship][term.name] for term in terms])
    model = VesselModel(
        terms=terms, parameters=values, parameter_std=relative_std * np.abs(values), form="continuous",
        sample_time_s=sample_time_s, actuators=actuators,
    )  # fmt: skip
    return Vessel(name=ship, length_m=60.0, beam_m=12.0, draught_m=2.5, sample_time_s=sample_time_s, model=model)


@dataclass(frozen=True, kw_only=True)
class Told:
    """What is hidden in a trial: as in `hidden_effects`, and `factors` of parameters.

    Parameters are drawn around the model's with `relative_std` first.
    """

    effects: Mapping[str, float] = field(default_factory=dict)
    faults: Mapping[str, float] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)
    current: tuple[float, float] = (0.0, 0.0)
    wind: tuple[float, float] = (0.0, 0.0)
    relative_std: float = 0.0


def drawn_parameters(ship: str, one: Told, rng: np.random.Generator) -> dict[str, float]:
    """Parameters of the true ship."""
    chance = {name: rng.standard_normal() for name in sea.SHIPS[ship]}
    return {
        name: value * (1 + one.relative_std * chance[name]) * one.factors.get(name, 1.0)
        for name, value in sea.SHIPS[ship].items()
    }


def hidden_records(
    ship: str,
    hidden: Sequence[Told],
    *,
    seed: int,
    batches: int = 6,
    samples: int = 300,
    step_s: float = 1.0,
    weather: sea.Weather | None = None,
    sensors: sea.Sensors | None = None,
    manoeuvre: str = "helmsman",
    shoaling: bool = False,
) -> list[Record]:
    """A trial for each of what is hidden, otherwise the same.

    Args:
        ship, seed, batches, samples, step_s, weather, sensors: as in `hidden_effects`.
        hidden: what.
        manoeuvre: of `hidden_effects.MANOEUVRES`.
        shoaling: the depth varies along the track and is recorded.
    """
    trials = []
    for one in hidden:
        rng = np.random.default_rng(seed)
        parameters = drawn_parameters(ship, one, rng)
        trials.append(
            sea.Trial(ship=ship, effects=dict(one.effects), current=one.current, wind=one.wind, parameters=parameters)
        )
    orders = sea.MANOEUVRES[manoeuvre](ship, batches, samples, step_s, rng)
    depth = sea.depths(batches, samples, step_s, rng) if shoaling else None
    shape = (len(trials), batches, samples)
    true = sea.sail(
        trials, np.broadcast_to(orders, (*shape, orders.shape[-1])), step_s, weather or sea.Weather(), rng,
        None if depth is None else np.broadcast_to(depth, shape),
    )  # fmt: skip
    told = sea.measure(true, step_s, sensors or sea.Sensors(), rng, [dict(one.faults) for one in hidden])

    def stacked(trial: int, number: int, *names: str) -> np.ndarray:
        return np.column_stack([told[name][trial, number] for name in names])

    return [
        Record(
            batches=tuple(
                Batch(
                    name=f"trial, batch {number}",
                    sample_time_s=step_s,
                    input_names=sea.INPUTS[ship],
                    inputs=orders[number],
                    velocity=stacked(trial, number, "u_mps", "v_mps", "r_radps"),
                    pose=stacked(trial, number, "north_m", "east_m", "heading_rad"),
                    wind=stacked(trial, number, "wind_u_mps", "wind_v_mps"),
                    depth_m=None if depth is None else depth[number],
                )
                for number in range(batches)
            )
        )
        for trial in range(len(trials))
    ]


def hidden_record(
    ship: str,
    *,
    effects: dict[str, float] | None = None,
    faults: dict[str, float] | None = None,
    factors: dict[str, float] | None = None,
    current: tuple[float, float] = (0.0, 0.0),
    wind: tuple[float, float] = (0.0, 0.0),
    relative_std: float = 0.0,
    **options,
) -> Record:
    """One trial of `hidden_records`."""
    one = Told(
        effects=effects or {}, faults=faults or {}, factors=factors or {}, current=current, wind=wind,
        relative_std=relative_std,
    )  # fmt: skip
    return hidden_records(ship, [one], **options)[0]


def from_pose(batch: Batch, *, smoothed: bool = False, wind: bool = True) -> Batch:
    """A batch as it is read from a file without velocities."""
    if smoothed:
        found, kept = smoothed_velocity(batch.pose, batch.sample_time_s), slice(None)
    else:
        found, kept = central_difference(batch.pose, batch.sample_time_s), slice(1, -1)
    return replace(
        batch, velocity=found, pose=batch.pose[kept], inputs=batch.inputs[kept], derived=("u", "v", "r"),
        wind=batch.wind[kept] if wind else None, depth_m=None if batch.depth_m is None else batch.depth_m[kept],
    )  # fmt: skip
