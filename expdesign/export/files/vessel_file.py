"""A vessel as a vessel file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from expdesign.errors import InputError
from expdesign.export.files.text import entry, toml_comments, toml_key, toml_table, toml_value
from expdesign.values import Array
from expdesign.vessel import (
    EXACT,
    KINDS,
    STRUCTURES,
    UNSTATED_SHARE,
    Actuator,
    Environment,
    RollPendulum,
    Sensors,
    Variation,
    Vessel,
    VesselModel,
    limit_keys,
    response_keys,
)


def vessel_toml(vessel: Vessel, *, comments: Sequence[str] = ()) -> str:
    """The vessel file of a vessel; reading it back gives the same vessel, to the last bit.

    Args:
        vessel: to be written; infinite limits are left out.
        comments: lines to go first.

    Raises:
        InputError: the model's sample time is not the vessel's, which a file cannot express.
    """
    if vessel.model.sample_time_s != vessel.sample_time_s:
        raise InputError(
            f"vessel {vessel.name!r} has sample time {vessel.sample_time_s:g} s and its model "
            f"{vessel.model.sample_time_s:g} s, expected the same in a vessel file"
        )
    particulars = {name: getattr(vessel, name) for name in ("name", "length_m", "beam_m", "draught_m", "sample_time_s")}
    lines = [*toml_comments(comments), *toml_table("[vessel]", particulars)]
    for actuator in vessel.actuators:
        lines += ["", *toml_table("[[actuators]]", _actuator(actuator))]
    lines += _model(vessel.model)
    if vessel.sensors != EXACT:
        lines += ["", *toml_table("[sensors]", _sensors(vessel.sensors))]
    if vessel.std:
        lines += ["", *toml_table("[std]", vessel.std)]
    if vessel.pendulum is not None:
        lines += _pendulum(vessel.pendulum)
    lines += _environment(vessel.environment)
    return "\n".join(lines) + "\n"


def _actuator(actuator: Actuator) -> dict[str, str | float]:
    entries = entry(actuator, "kind", "forward_m", "starboard_m")
    for stem, limit, response in zip(KINDS[actuator.kind], actuator.limits, actuator.responses, strict=True):
        values = zip(limit_keys(stem), (limit.low, limit.high), strict=True)
        entries |= {key: value for key, value in values if math.isfinite(value)}
        fields = ((key, getattr(response, name)) for name, key in response_keys(stem).items())
        entries |= {key: value for key, value in fields if value and math.isfinite(value)}
    return entries


def _sensors(sensors: Sensors) -> dict[str, str | float]:
    """Entries that differ from the defaults."""
    return {name: value for name, value in vars(sensors).items() if value != getattr(EXACT, name)}


def _environment(environment: Environment) -> Iterator[str]:
    flows = {
        "current_to": (environment.current_to, environment.current_std_mps, environment.current_variation),
        "wind_to": (environment.wind_to, environment.wind_std_mps, environment.wind_variation),
    }
    rows = {name: _flow(*flow) for name, flow in flows.items()}
    known = {name: row for name, row in rows.items() if any(row.values())}
    if known or environment.sea_state is not None:
        yield from ("", "[environment]")
    if environment.sea_state is not None:
        yield f"sea_state = {environment.sea_state}"
    for name, row in known.items():
        yield f"{name} = {{{', '.join(f'{key} = {toml_value(value)}' for key, value in row.items())}}}"


def _flow(to: Array, std_mps: float, variation: Variation) -> dict[str, float]:
    north, east = to.tolist()
    certain = {"north_mps": north, "east_mps": east}
    rest = {
        "std_mps": std_mps,
        "variation_std_mps": variation.std_mps,
        "correlation_s": variation.correlation_s,
    }
    return certain | {key: value for key, value in rest.items() if value}


def _model(model: VesselModel) -> Iterator[str]:
    structure = next((name for name, terms in STRUCTURES.items() if terms == model.terms), "custom")
    unstated = _unstated(model)
    yield from ("", *toml_table("[model]", {"structure": structure, "form": model.form, **unstated}))
    if model.speeds_mps is not None:
        yield f"speeds_mps = [{', '.join(f'{speed:.4g}' for speed in model.speeds_mps)}]"
    if model.missed is not None:
        yield f"missed = {{ way_share = {model.missed.way_share:.4g}, turn_share = {model.missed.turn_share:.4g} }}"
    if structure == "custom":
        for term in model.terms:
            yield from ("", *toml_table("[[model.terms]]", vars(term)))
    values, stds = model.parameters.tolist(), model.parameter_std.tolist()
    yield from ("", *toml_table("[model.parameters]", dict(zip(model.names, values, strict=True))))
    open_ = model.drawn_std > model.parameter_std
    rows = zip(model.names, stds, open_.tolist(), strict=True)
    known = {name: std for name, std, unstated in rows if std > 0 or (open_.any() and not unstated)}
    if known:
        yield from ("", *toml_table("[model.parameter_std]", known))
    yield from _correlation(model)
    for key, side in (("parameter_min", 0), ("parameter_max", 1)):
        stated = {name: ends[side] for name, ends in model.parameter_range.items() if math.isfinite(ends[side])}
        if stated:
            yield from ("", *toml_table(f"[model.{key}]", stated))
    if model.roll is not None:
        known = {key: value for key, value in vars(model.roll).items() if key != "heel_rad_per_mps2" or value}
        yield from ("", *toml_table("[model.roll]", known))
    if model.inertia is not None:
        stated = {key: value for key, value in vars(model.inertia).items() if value is not None}
        yield from ("", *toml_table("[model.inertia]", stated))


def _unstated(model: VesselModel) -> dict[str, float]:
    """The share of their values with which parameters without a standard deviation differ, if it is not the usual."""
    open_ = model.drawn_std > model.parameter_std
    if not open_.any():
        return {} if (model.parameter_std > 0).all() else {"parameter_std_unstated": 0.0}
    share = float(np.median(model.drawn_std[open_] / np.abs(model.parameters[open_])))
    return {} if math.isclose(share, UNSTATED_SHARE) else {"parameter_std_unstated": share}


def _pendulum(pendulum: RollPendulum) -> Iterator[str]:
    body, load = pendulum.body, pendulum.load
    heights: dict[str, str | float] = {
        "mass_kg": body.mass_kg, "mass_height_m": -body.z_g, "sensor_height_m": -body.z_s,
    }  # fmt: skip
    if math.isfinite(pendulum.heel_max_rad):
        heights["heel_max_deg"] = math.degrees(pendulum.heel_max_rad)
    if body.forward_m:
        heights["sensor_forward_m"] = body.forward_m
    if body.tilt_rad is not None:
        heights["sensor_tilt_deg"] = math.degrees(body.tilt_rad)
    yield from ("", *toml_table("[roll]", heights))
    if body.sensor_from_axis:
        yield "sensor_above_axis = true"
    yield from ("", *toml_table("[roll.parameters]", pendulum.parameters))
    if pendulum.parameter_std:
        yield from ("", *toml_table("[roll.parameter_std]", pendulum.parameter_std))
    given = pendulum.parameter_correlation
    if given:
        rows = {one: {other: value for (name, other), value in given.items() if name == one} for one, _ in given}
        yield from ("", "[roll.parameter_correlation]", *(_pairs(name, pairs) for name, pairs in rows.items()))
    if load.mass_kg:
        stated = {"mass_kg": load.mass_kg, "height_m": -load.z_m, "inertia_kgm2": load.inertia_kgm2}
        yield from ("", *toml_table("[roll.load]", stated))
    if pendulum.waves is not None:
        waves = {"from_deg": math.degrees(pendulum.waves.from_rad), **vars(pendulum.waves)}
        yield from ("", *toml_table("[roll.waves]", {key: value for key, value in waves.items() if key != "from_rad"}))


def _correlation(model: VesselModel) -> Iterator[str]:
    """Correlations of parameters with standard deviations, a line for each parameter with those before it."""
    correlation, known = model.parameter_correlation_matrix, model.parameter_std > 0
    rows = []
    for place, name in enumerate(model.names):
        pairs = {
            model.names[other]: value
            for other, value in enumerate(correlation[place, :place].tolist())
            if value and known[place] and known[other]
        }
        rows += [_pairs(name, pairs)] * bool(pairs)
    if rows:
        yield from ("", "[model.parameter_correlation]", *rows)


def _pairs(name: str, pairs: Mapping[str, float]) -> str:
    return f"{toml_key(name)} = {{ {', '.join(f'{toml_key(other)} = {value:.9g}' for other, value in pairs.items())} }}"
