"""Figures of a diagnosis: measured and simulated velocities, error growth, and errors against variables."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis import Diagnosis, Finding
from expdesign.diagnosis.accuracy import Dependence, dependence
from expdesign.diagnosis.model import FOLLOWING, ExtendedModel, ahead_force, ahead_force_text, group_columns
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.export.document import Figure
from expdesign.export.estimate_figures import AXES, thinned
from expdesign.export.pages.figures import BLUE, GREY, VERMILION, light_grid, new_figure, page_figure, short, svg
from expdesign.values import Array
from expdesign.vessel import NUMPY, column_name, generalised_force
from expdesign.vessel.quantities import GAINS_AND_OFFSETS
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS, SHOAL, parse_expression

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.transforms import Bbox

CHANGED_INPUTS = 0.2  # change of inputs, summed in units of their standard deviations, that counts as one
# errors beyond so many standard deviations of the measurements are not drawn: the simulation has diverged
MOST_SPREADS = 3.0
COLOURED_BY_CHANCE = 0.01  # probability that any panel is coloured if nothing depends on anything
DEGREES = float(np.degrees(1.0))
SQUARED = "\N{SUPERSCRIPT TWO}"
SPEEDS = {"u": ("u [m/s]", 1.0), "v": ("v [m/s]", 1.0), "r": ("r [\N{DEGREE SIGN}/s]", DEGREES)}
RATES = {
    "u": (f"rate of change of u [m/s{SQUARED}]", 1.0),
    "v": (f"rate of change of v [m/s{SQUARED}]", 1.0),
    "r": (f"rate of change of r [\N{DEGREE SIGN}/s{SQUARED}]", DEGREES),
}
FORCES = ("term", "theta", "gain", "asymmetry", "deadband", "offset", "scale", "shallow")
"""Kinds of effects that are forces."""
SHOWN_BY = {"late:psi": "r", "late:position": "u", "heading_bias": "u", "lever": "r"} | {
    row.effects[0]: row.signals[0] for row in GAINS_AND_OFFSETS
}
"""Effect, or kind of effect, of a sensor -> the velocity that it depends on."""


def is_force(found: Diagnosis, item: Finding) -> bool:
    """Whether the cause is a force without delay, which is visible in the missing acceleration."""
    kind = item.keys[0].partition(":")[0]
    return kind in FORCES and (item.cause != "wind" or found.windows.has_wind)


def has_sign(item: Finding) -> bool:
    """Whether the error changes its sign with the variable; otherwise only its size grows."""
    return item.keys[0].partition(":")[0] not in (*FOLLOWING, "roll", "change")


def suspected_force(found: Diagnosis, item: Finding, at: Mapping[str, Array]) -> tuple[Array, str]:
    """The variable that a force depends on, and its label.

    Args:
        item: one of its findings.
        at: (k,) variables of `Residuals` by name.
    """
    ship = extended_model(found.vessel, found.record)
    kind, _, rest = _most_significant(found, item).partition(":")
    if item.cause == "wind":
        return np.hypot(at["u_q"], at["v_q"]), "wind over deck [m/s]"
    if kind == "shallow":
        return at["depth"], "water depth [m]"
    if kind in ("deadband", "offset", "scale"):
        name = ship.model.inputs[group_columns(rest, ship.model.inputs)[0]]
        return at[name], f"{name} [{column_name(name).removeprefix(name).strip('_') or 'force'}]"
    table = signals(ship, at)
    if kind in ("gain", "asymmetry"):
        return ahead_force(table, ship.model), f"ahead force, {ahead_force_text(ship.model)}"
    known = (*ship.library.values(), *found.extended.model.terms, *ship.model.terms)  # unlisted ones are those found
    term = {one.name: one for one in known}[rest]
    names = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *ship.model.inputs)))
    values = parse_expression(term.expression, signals=names).evaluate(table, NUMPY)
    return np.broadcast_to(values, at["time"].shape), f"{term.name}: {term.expression}"


def signals(ship: ExtendedModel, at: Mapping[str, Array]) -> dict[str, Array]:
    """(k,) signals that terms read; nan where not measured."""
    nothing = np.full(at["time"].shape, np.nan)
    forces = generalised_force(ship.model.actuators, at, NUMPY)
    shoal = ship.draught_m / at["depth"] if "depth" in at else np.zeros_like(nothing)
    motion = {name: at.get(name, nothing) for name in MOTION_SIGNALS} | {SHOAL: shoal}
    table = {name: np.broadcast_to(force, nothing.shape) for name, force in zip(FORCE_SIGNALS, forces, strict=True)}
    table |= {name: at[name] for name in ship.model.inputs} | motion
    return table | {name: product.evaluate(table, NUMPY) for name, product in ship.input_products.items()}


def suspected(found: Diagnosis, item: Finding) -> tuple[Array, str]:
    """(w, s) values of the variable that an error depends on, at the compared samples, and their label."""
    key = item.keys[0]
    kind, _, rest = key.partition(":")
    if kind in FOLLOWING:
        inputs = extended_model(found.vessel, found.record).model.inputs
        return _since_change(found, group_columns(rest, inputs))
    if kind == "inertia" or key in ("late:u", "late:v", "late:r"):
        return _rate(found, rest)
    if key in SHOWN_BY or kind in SHOWN_BY:
        return _speed(found, SHOWN_BY.get(key, SHOWN_BY.get(kind, "u")))
    return _heading(found) if kind == "current" or item.cause == "wind" else _time(found)


def _most_significant(found: Diagnosis, item: Finding) -> str:
    """The estimate with the largest change in standard errors, among parameters; else the first."""
    model = found.vessel.model
    known = dict(zip(model.names, model.parameters.tolist(), strict=True))
    sizes = [abs(one.value - known.get(one.name, 0.0)) / one.std if one.std > 0 else 0.0 for one in item.estimates]
    if item.cause == "parameters" and sizes:
        return item.keys[int(np.argmax(sizes))]
    return item.keys[0]


def _since_change(found: Diagnosis, columns: list[int]) -> tuple[Array, str]:
    windows = found.windows
    inputs = windows.step_inputs[:, :: windows.steps_per_sample, columns]
    scale = np.maximum(np.std(inputs.reshape(-1, inputs.shape[-1]), axis=0), 1e-12)
    change = np.zeros(inputs.shape[:2])
    change[:, 1:] = np.abs(np.diff(inputs, axis=1) / scale).sum(axis=2)
    return _since(np.asarray(change > CHANGED_INPUTS)) * windows.sample_s, "time since the input changed [s]"


def _since(events: NDArray[np.bool_]) -> Array:
    """(w, s) samples since the last event."""
    result = np.full(events.shape, np.nan)
    for row, happened in zip(result, events, strict=True):
        last = None
        for index, now in enumerate(happened):
            last = index if now else last
            if last is not None:
                row[index] = index - last
    return result


def _rate(found: Diagnosis, output: str) -> tuple[Array, str]:
    label, factor = RATES[output]
    values = found.windows.measured[..., "uvr".index(output)]
    return np.asarray(factor * np.gradient(values, found.windows.sample_s, axis=1)), label


def _speed(found: Diagnosis, output: str) -> tuple[Array, str]:
    label, factor = SPEEDS[output]
    return np.asarray(factor * found.windows.measured[..., "uvr".index(output)]), label


def _heading(found: Diagnosis) -> tuple[Array, str]:
    heading = found.windows.heading[:, :: found.windows.steps_per_sample]
    return np.asarray(DEGREES * (heading % (2 * np.pi))), "heading [\N{DEGREE SIGN}]"


def _time(found: Diagnosis) -> tuple[Array, str]:
    return found.windows.time_s[:, :: found.windows.steps_per_sample] / 60, "time [min]"


BINS, FEWEST = 16, 15  # largest number of groups, and smallest number of samples in each
ACCELERATION_AXES = {
    "u": ("u [mm/s\N{SUPERSCRIPT TWO}]", 1000.0),
    "v": ("v [mm/s\N{SUPERSCRIPT TWO}]", 1000.0),
    "r": ("r [\N{DEGREE SIGN}/min\N{SUPERSCRIPT TWO}]", 3600 * DEGREES),
}
VARIABLES = {
    "u": "u [m/s]", "v": "v [m/s]", "r": "r [\N{DEGREE SIGN}/s]", "u_q": "u through the air [m/s]",
    "v_q": "v through the air [m/s]", "depth": "depth [m]", "heading": "heading [\N{DEGREE SIGN}]",
    "time": "time [min]", "run": "run",
}  # fmt: skip


@page_figure
def window_figure(found: Diagnosis, index: int) -> str:
    """One stretch of data: measured, simulated by the model in use, simulated by the extended one."""
    outputs = found.before.outputs
    figure = new_figure(7.2, 0.7 + 1.4 * len(outputs))
    rows = np.atleast_1d(figure.subplots(len(outputs), 1, sharex=True))
    windows = found.windows
    time = np.asarray(windows.sample_s * np.arange(windows.measured.shape[1]), dtype=float)
    for axes, output in zip(rows, outputs, strict=True):
        label, factor = AXES[output]
        column = OUTPUTS.index(output)
        measured = np.asarray(factor * windows.measured[index, :, column], dtype=float)
        axes.plot(*thinned(time, measured), color="#b0b0b0", linewidth=2.6, label="measured")
        for shown, colour, name in (
            (found.simulated_before, VERMILION, "model in use"),
            (found.simulated_after, BLUE, "extended model"),
        ):
            if name == "model in use" or found.is_extended:
                values = np.asarray(
                    np.where(np.isfinite(measured), factor * shown[index, :, column], np.nan), dtype=float
                )
                axes.plot(*thinned(time, values), color=colour, linewidth=1.1, label=name)
        axes.set_ylabel(label, fontsize=9)
        light_grid(axes)
    rows[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    return svg(figure, key=f"window{index}", label="Measured and simulated velocities over time")


@page_figure
def growth_figure(found: Diagnosis) -> str:
    """Error of the simulation against the time since it started from a measured state."""
    outputs = found.before.outputs
    figure = new_figure(7.2, 2.4)
    columns = np.atleast_1d(figure.subplots(1, len(outputs)))
    for index, (axes, output) in enumerate(zip(columns, outputs, strict=True)):
        label, factor = AXES[output]
        axes.plot(found.before.horizons_s, factor * found.before.growth[:, index], "o-", color=VERMILION,
                  label="model in use", markersize=3.5)  # fmt: skip
        if found.is_extended:
            axes.plot(found.after.horizons_s, factor * found.after.growth[:, index], "s-", color=BLUE,
                      label="extended model", markersize=3.5)  # fmt: skip
        axes.set_xscale("log")
        axes.set_xticks(found.before.horizons_s, [f"{value:g}" for value in found.before.horizons_s])
        axes.minorticks_off()
        spread = factor * float(np.nanstd(found.windows.measured[..., OUTPUTS.index(output)]))
        # autoscale leaves a margin of the range of values, which of a level line is none: it seemed to leave the figure
        high = float(axes.dataLim.intervaly[1])
        top = 1.15 * high if high > 0.0 else 1.0
        axes.set_ylim(0.0, min(top, MOST_SPREADS * spread) if spread > 0 else top)
        axes.set_title(f"error of {label}")
        axes.set_xlabel("time since the start [s]")
        light_grid(axes)
    columns[0].legend(fontsize=8)
    return svg(figure, key="growth", label="Root mean square error of the simulation against its horizon")


@page_figure
def suspect_figure(found: Diagnosis, index: int, key: str) -> str:
    """The error without a finding, or the missing acceleration, against the variable that it should depend on."""
    outputs, item = found.before.outputs, found.findings[index]
    if is_force(found, item):
        values, label = suspected_force(found, item, found.step_residuals[index].variables)
        what, axis, rows = "missing", ACCELERATION_AXES, np.moveaxis(found.step_residuals[index].acceleration, 1, 0)
    else:
        values, label = suspected(found, item)
        what, axis = "error of", AXES
        rows = np.stack([found.errors[index][..., OUTPUTS.index(output)] for output in outputs])
    figure = new_figure(7.2, 2.5)
    columns = np.atleast_1d(figure.subplots(1, len(outputs)))
    for axes, output, row in zip(columns, outputs, rows, strict=True):
        name, factor = axis[output]
        _scatter(axes, values, factor * row, signed=has_sign(item))
        axes.set_title(f"{what} {name}")
        axes.ticklabel_format(axis="x", scilimits=(-3, 4))  # else labels of small numbers overlap
        light_grid(axes)
    figure.supxlabel(short(label), fontsize=10)  # one for all: beside each other they are wider than their axes
    return svg(figure, key=key, label=f"Error of the simulation against {label}")


def _scatter(axes: Axes, x: Array, y: Array, *, signed: bool) -> None:
    """Every sample in grey, means or root mean squares of equal numbers of samples in colour."""
    seen = np.isfinite(x) & np.isfinite(y)
    a, b = x[seen], y[seen]
    if len(a) == 0:
        return
    step = max(1, len(a) // 1500)
    axes.plot(a[::step], b[::step], ".", color="#c8c8c8", markersize=2, rasterized=False)
    edges = np.unique(np.quantile(a, np.linspace(0, 1, min(BINS, max(len(a) // FEWEST, 2)) + 1)))
    place = np.clip(np.searchsorted(edges, a, side="right") - 1, 0, max(len(edges) - 2, 0))
    groups = [place == number for number in range(len(edges) - 1) if (place == number).any()]
    middles = [float(np.mean(a[group])) for group in groups]
    sizes = [float(np.mean(b[group]) if signed else np.sqrt(np.mean(b[group] ** 2))) for group in groups]
    axes.plot(middles, sizes, "o-", color=VERMILION, markersize=4, linewidth=1.2)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    low, high = np.quantile(b, [0.005, 0.995])
    axes.set_ylim(low - 0.1 * (high - low + 1e-12), high + 0.1 * (high - low + 1e-12))


def residual_figures(found: Diagnosis) -> list[tuple[bool, Figure]]:
    """Of the missing acceleration against every variable, clearest first: whether it is significant, and the figure."""
    residuals = found.residuals
    if not residuals.sufficient:
        return []
    tests = {
        name: [dependence(residuals, output, name) for output in residuals.outputs]
        for name, values in residuals.variables.items()
        if np.ptp(values) > 0
    }
    clear = COLOURED_BY_CHANCE / sum(len(items) for items in tests.values())
    limits = [1.15 * max(float(np.abs(items[i].mean).max() + items[i].std.max()) for items in tests.values())
              for i in range(len(residuals.outputs))]  # fmt: skip
    ranked = sorted(tests, key=lambda name: min(item.p_value for item in tests[name]))
    places: list[Bbox] = []
    return [
        (
            any(item.p_value < clear for item in tests[name]),
            Figure(draw=partial(_residual_figure, name, residuals.outputs, tests[name], limits, clear, places)),
        )
        for name in ranked
    ]


RIGHT_EDGE = 0.94
"""Of the axes of a figure that takes the places of another, in its width: room for half of a number at their end."""


@page_figure
def _residual_figure(
    name: str,
    outputs: tuple[str, ...],
    items: list[Dependence],
    limits: list[float],
    clear: float,
    places: list[Bbox],
) -> str:
    """One variable: means of the residual with two standard errors, an output above the other.

    The limits and sizes of all such figures are the same, so `places` of their axes are found for the first of them.
    """
    figure = new_figure(2.6, 0.55 + 0.95 * len(outputs), layout=None if places else "constrained")
    rows = np.atleast_1d(figure.subplots(len(outputs), 1, sharex=True))
    factor = DEGREES if name == "heading" else 1 / 60 if name == "time" else DEGREES if name == "r" else 1.0
    for axes, output, item, limit in zip(rows, outputs, items, limits, strict=True):
        label, scale = ACCELERATION_AXES[output]
        colour = VERMILION if item.p_value < clear else BLUE
        axes.axhline(0.0, color=GREY, linewidth=0.8)
        axes.errorbar(factor * item.middle + (name == "run"), scale * item.mean, 2 * scale * item.std, fmt="o-",
                      color=colour, markersize=3, linewidth=1.0, elinewidth=1.0)  # fmt: skip
        axes.set_ylim(-scale * limit, scale * limit)
        axes.set_ylabel(label, fontsize=8)
        axes.tick_params(labelsize=8)
        axes.locator_params(axis="y", nbins=4)
        light_grid(axes)
    rows[-1].set_xlabel(variable_label(name), fontsize=9)
    figure.align_ylabels()
    for axes, place in zip(rows, places, strict=False):
        axes.set_position((place.x0, place.y0, min(place.x1, RIGHT_EDGE) - place.x0, place.height))
    label = f"Acceleration that the model lacks against {variable_label(name)}"
    drawn = svg(figure, key=f"residual-{name}", label=label)
    places += [] if places else [axes.get_position() for axes in rows]
    return drawn


def variable_label(name: str) -> str:
    """A variable of the residuals with its unit."""
    unit = column_name(name).removeprefix(name).strip("_")
    return VARIABLES.get(name, f"{name} [{unit}]" if unit else name)
