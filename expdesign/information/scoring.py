"""Scoring a dictionary: primitives of one length, all headings and all models are simulated together.

Source: F. Ljungberg, doctoral thesis, Linköping University, (7.50)-(7.57).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from expdesign.dictionary import Primitive
from expdesign.errors import Diverged, UnknownName
from expdesign.estimation.regression import AIR
from expdesign.information.excitation import (
    EXCITATIONS,
    FREE,
    REQUIRED,
    Strata,
    kept_runs,
    most_strata,
    strata,
    whole_runs,
)
from expdesign.information.moments import (
    HEADINGS,
    MEAN_SUBTRACTIONS,
    RUNS_AT_ONCE,
    PrimitiveInformation,
    estimated_parameters,
    log_det_or_none,
    over_shares,
    rows_of,
    signals_of,
)
from expdesign.simulation import CALM, Environment, deliver, rk4_step, simulate, step_shares, to_body
from expdesign.simulation.motion import begun
from expdesign.simulation.program import STATES, RatesProgram, march
from expdesign.simulation.run import LARGEST_SPEED, SUBSTEPS
from expdesign.values import Array
from expdesign.vessel import NUMPY, Vessel

SIMULATED_SAMPLES = 3_000_000  # samples simulated together
EVALUATED_SAMPLES = 500_000  # samples of regressors evaluated together


def score_primitives(
    vessel: Vessel,
    primitives: Iterable[Primitive],
    *,
    environment: Environment = CALM,
    fixed_parameters: Sequence[str] = (),
    mean_subtraction: str = "complete",
    excitation: str = FREE,
) -> tuple[PrimitiveInformation, ...]:
    """Information of every primitive about the parameters to estimate.

    In a mean current or wind, each primitive is simulated on `HEADINGS` evenly spread headings and its moments
    are averaged, because its heading is not known before the plan.

    Args:
        environment: mean current and wind, and their spread.
        fixed_parameters: held at the nominal values.
        mean_subtraction: "none", "batch" or "complete".
        excitation: which samples count in each equation, see `information.excitation`.

    Raises:
        UnknownName: no such parameter, mean subtraction or choice of samples.
        InputError: every parameter is fixed.
        Diverged: the nominal model is unstable.
    """
    ((scored, _),) = score_models(
        vessel,
        tuple(primitives),
        vessel.model.parameters[None],
        environment=environment,
        fixed_parameters=fixed_parameters,
        mean_subtraction=mean_subtraction,
        excitation=excitation,
    )
    return scored


def score_models(
    vessel: Vessel,
    primitives: Sequence[Primitive],
    parameters: Array,
    *,
    environment: Environment = CALM,
    fixed_parameters: Sequence[str] = (),
    mean_subtraction: str = "complete",
    excitation: str = FREE,
    unstable: str = "raise",
) -> tuple[tuple[tuple[PrimitiveInformation, ...], bool], ...]:
    """As `score_primitives`, for several parameter vectors (m, all) of the same structure under the same commands.

    Args:
        vessel, primitives, environment, fixed_parameters, mean_subtraction, excitation: as in `score_primitives`.
        parameters: (m, all) in the model's own form.
        unstable: "raise" when a model diverges, or "mark".

    Returns:
        For each model the information and whether it stayed stable; the information of an unstable one is nan.

    Raises:
        UnknownName, InputError, Diverged: as in `score_primitives`.
    """
    names = estimated_parameters(vessel.model, fixed_parameters)
    if mean_subtraction not in MEAN_SUBTRACTIONS:
        raise UnknownName("mean subtraction", mean_subtraction, known=MEAN_SUBTRACTIONS)
    if excitation not in EXCITATIONS:
        raise UnknownName("choice of samples", excitation, known=EXCITATIONS)
    p, m, count = len(names), len(parameters), len(primitives)
    n = len(vessel.model.outputs) if excitation == FREE else sum(most_strata(vessel.model))
    found = _Moments(
        X=np.zeros((m, count, p, p)),
        Y=np.zeros((m, count, p, n)),
        YZ=np.zeros((m, count, p, p)),
        shares=np.zeros((m, count, len(vessel.model.outputs))),
        used=np.full((m, count, n), float(excitation == FREE)),
        clear=np.zeros((m, count, len(vessel.model.outputs)), dtype=bool),
    )
    for members in _groups(primitives, len(parameters) * len(_headings(environment))):
        stack = _Runs.of(vessel, [primitives[index] for index in members], parameters, environment)
        part = stack.moments(names, excitation)
        if unstable == "raise" and not np.isfinite(part.X).all():
            _raise_diverged(vessel, [primitives[index] for index in members], environment)
        for name in vars(found):
            getattr(found, name)[:, members] = getattr(part, name)
    found, outputs = found if excitation == FREE else found.with_used_columns(), vessel.model.outputs
    stable = np.asarray(np.isfinite(found.X).all(axis=(1, 2, 3)))
    return tuple(
        (
            tuple(
                found.item(model, index, primitive, mean_subtraction, outputs)
                for index, primitive in enumerate(primitives)
            ),
            bool(stable[model]),
        )
        for model in range(m)
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Moments:
    """X, Y, YZ and shares of samples (m, n, ...) of runs under every model, averaged over headings.

    Shares (m, n, outputs) are of the samples that meet the excitation condition, heading by heading; it is clear where
    it holds throughout on all headings.
    """

    X: Array
    Y: Array
    YZ: Array
    used: Array
    shares: Array
    clear: NDArray[np.bool_]

    def with_used_columns(self) -> _Moments:
        """Without strata that no run has."""
        columns = np.flatnonzero(self.used.any(axis=(0, 1)))
        return replace(self, Y=self.Y[..., columns], used=self.used[..., columns])

    def item(
        self, model: int, index: int, primitive: Primitive, mean_subtraction: str, outputs: Sequence[str]
    ) -> PrimitiveInformation:
        X, Y, YZ, used = (getattr(self, name)[model, index] for name in ("X", "Y", "YZ", "used"))
        complete = over_shares(Y, used) @ Y.T
        taken = {"none": np.zeros_like(X), "batch": YZ, "complete": complete}[mean_subtraction]
        clear = self.clear[model, index]
        return PrimitiveInformation(
            primitive=primitive,
            X=X,
            Y=Y,
            Z=Y,
            YZ=YZ,
            log_det_alone=log_det_or_none(X - taken, np.diag(X)) if np.isfinite(X).all() else None,
            excitation_condition=bool(clear.all()),
            excites=dict(zip(outputs, clear.tolist(), strict=True)),
            clear_share=dict(zip(outputs, self.shares[model, index].tolist(), strict=True)),
            used=used,
        )


def _headings(environment: Environment) -> Array:
    return np.zeros(1) if environment.isotropic else np.asarray(2 * np.pi * np.arange(HEADINGS) / HEADINGS)


def _groups(primitives: Sequence[Primitive], copies: int) -> Iterator[list[int]]:
    """Indices of primitives to simulate together: of one length, within the memory limit."""
    lengths: dict[tuple[int, float], list[int]] = {}
    for index, primitive in enumerate(primitives):
        key = (len(primitive.commands), primitive.commands.sample_time_s)
        lengths.setdefault(key, []).append(index)
    for (samples, _), members in lengths.items():
        size = max(1, SIMULATED_SAMPLES // (samples * copies))
        yield from (members[first : first + size] for first in range(0, len(members), size))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Runs:
    """Simulated runs: models m, headings h, primitives n, samples k."""

    # vessel, environment: as given
    vessel: Vessel
    environment: Environment
    inputs: Array  # (k, inputs, n) mean delivered input of each sample
    states: Array  # (k, 6, m, h, n) at the start of every command; nan where a run diverges

    @staticmethod
    def of(vessel: Vessel, primitives: Sequence[Primitive], parameters: Array, environment: Environment) -> _Runs:
        commands = np.array([primitive.commands.values for primitive in primitives]).transpose(1, 2, 0)
        standing = np.array([primitive.entry_inputs for primitive in primitives]).T
        sample_time_s = primitives[0].commands.sample_time_s
        shares = step_shares(vessel.responses, sample_time_s=sample_time_s, substeps=SUBSTEPS)
        given = deliver(vessel.responses, commands, sample_time_s=sample_time_s, substeps=shares, standing=standing)
        entry = np.array([primitive.entry_velocity for primitive in primitives]).T
        states = _sailed(vessel, given, entry, parameters, environment, shares * sample_time_s)
        inputs = given[:, 0] if given.shape[1] == 1 else np.einsum("ksmn,s->kmn", given, shares)
        return _Runs(vessel=vessel, environment=environment, inputs=inputs, states=states)

    def moments(self, names: Sequence[str], excitation: str) -> _Moments:
        """Averages over headings, some primitives at a time."""
        samples, _, models, headings, count = self.states.shape
        size = max(1, EVALUATED_SAMPLES // (samples * models * headings))
        parts = [self._some(slice(first, first + size), names, excitation) for first in range(0, count, size)]
        columns = {name: np.concatenate([getattr(part, name) for part in parts], axis=1) for name in vars(parts[0])}
        return _Moments(**columns)

    def _some(self, chosen: slice, names: Sequence[str], excitation: str) -> _Moments:
        model, p = self.vessel.model, len(names)
        states = np.moveaxis(self.states[..., chosen], 1, 0)  # (6, k, m, h, n)
        inputs = self.inputs[:, :, None, None, chosen].swapaxes(0, 1)  # (inputs, k, 1, 1, n)
        with np.errstate(invalid="ignore", over="ignore"):
            table = signals_of(model, tuple(states), inputs, self.environment)
            rows = rows_of(model, table, states.shape[1:])[[model.names.index(name) for name in names]]
            groups = strata(
                self.vessel,
                table,
                self.environment,
                shape=states.shape[1:],
                air_measured=excitation != FREE,
            )
        whole = whole_runs(groups)  # (outputs, m, h, n)
        if excitation == REQUIRED:
            groups = np.where(kept_runs(groups)[:, None], groups, 0).astype(np.int8)
        shares = (groups > 0).mean(axis=(1, 3))
        most = most_strata(model)
        if excitation == FREE:
            groups, most = np.ones((len(model.outputs), 1, 1, 1, 1), dtype=np.int8), [1] * len(model.outputs)
        models, count = rows.shape[2], rows.shape[4]
        X, YZ = np.zeros((models, count, p, p)), np.zeros((models, count, p, p))
        Y = np.zeros((models, count, p, sum(most)))
        used = np.full((models, count, sum(most)), float(excitation == FREE))
        equations = [model.terms[model.names.index(name)].equation for name in names]
        for number, output in enumerate(model.outputs):
            index = np.flatnonzero([equation == output for equation in equations])
            if not len(index):
                continue
            own = np.ascontiguousarray(rows[index].transpose(2, 3, 4, 0, 1))  # (m, h, n, own, k)
            place = np.ix_(np.arange(models), np.arange(count), index, index)
            for label in range(1, most[number] + 1):
                column = sum(most[:number]) + label - 1
                kept, share = _kept(own, groups[number], label)
                mean = kept.mean(axis=-1)
                X[place] += (kept @ own.swapaxes(-1, -2)).mean(axis=1) / own.shape[-1]
                YZ[place] += (
                    mean[..., :, None] * over_shares(mean[..., None], share[..., None])[..., None, :, 0]
                ).mean(axis=1)
                Y[:, :, index, column] = mean.mean(axis=1)
                used[:, :, column] = np.broadcast_to(share, mean.shape[:3]).mean(axis=1)
        clear = np.asarray(whole.all(axis=2)).transpose(1, 2, 0)
        return _Moments(X=X, Y=Y, YZ=YZ, used=used, shares=shares.transpose(1, 2, 0), clear=clear)


def _kept(own: Array, group: Strata, label: int) -> tuple[Array, Array]:
    """Rows (m, h, n, own, k) with zeros where another stratum (k, m, h, n) is, and the shares (m, h, n) of this one."""
    if group.size == 1:
        return own, np.ones((1, 1, 1))
    chosen = np.moveaxis(group == label, 0, -1)  # (m, h, n, k)
    return own * chosen[..., None, :], np.asarray(chosen.mean(axis=-1))


def _sailed(
    vessel: Vessel, given: Array, entry: Array, parameters: Array, environment: Environment, steps_s: Array
) -> Array:
    """(k, 6, m, h, n) states of all models on all headings, from entry velocities (3, n) through water.

    Without current and without aerodynamic terms, motion does not depend on heading: one heading is simulated and
    copied. Positions are not rotated.
    """
    headings = _headings(environment)
    if len(headings) > 1 and not environment.current_to.any() and not _moved_by_air(vessel, parameters):
        alone = _simulated(vessel, given, entry, parameters, CALM, steps_s, np.zeros(1))
        states = np.repeat(alone, len(headings), axis=3)
        states[:, 2] += headings[:, None]
        return states
    return _simulated(vessel, given, entry, parameters, environment, steps_s, headings)


def _moved_by_air(vessel: Vessel, parameters: Array) -> bool:
    """Whether any model has an aerodynamic force."""
    reads = [bool(set(AIR) & set(expression.signals)) for expression in vessel.model.expressions]
    return bool(parameters[:, reads].any())


def _simulated(
    vessel: Vessel,
    given: Array,
    entry: Array,
    parameters: Array,
    environment: Environment,
    steps_s: Array,
    headings: Array,
) -> Array:
    """(k, 6, m, h, n) states at the start of every command; runs that diverge are nan throughout.

    `given` (k, steps, inputs, n) are the delivered inputs in each integrator step, or (k, 1, ...) if constant; the
    steps take `steps_s` (steps,).
    """
    shape = (len(parameters), len(headings), entry.shape[1])
    current_b = to_body(environment.current_to, headings[:, None], NUMPY)
    at_entry = (0.0, 0.0, headings[:, None], entry[0] + current_b[0], entry[1] + current_b[1], entry[2])
    start = tuple(np.broadcast_to(value, shape).reshape(-1) for value in at_entry)
    first = np.array(begun(vessel.model, start))
    own = np.repeat(parameters, shape[1] * shape[2], axis=0)
    states = np.empty((len(given), STATES, first.shape[1]))
    size = shape[2] * max(1, RUNS_AT_ONCE // shape[2])
    for begin in range(0, first.shape[1], size):
        some = slice(begin, begin + size)
        runs = first[:, some].shape[1]
        program = RatesProgram(vessel.model, runs=runs, parameters=parameters[0] if len(parameters) == 1 else own[some])
        program.sea[...] = np.r_[environment.current_to, environment.wind_to][:, None]
        states[..., some] = _marched(program, given, first[:, some], steps_s)
    return states.reshape(len(states), STATES, *shape)


def _marched(program: RatesProgram, given: Array, start: Array, steps_s: Array) -> Array:
    """(k, 6, n) states at the start of every command; runs that diverge are nan throughout."""
    states, largest = np.empty((len(given), STATES, start.shape[1])), np.zeros(start.shape[1])
    with np.errstate(over="ignore", invalid="ignore"):
        marched = march(program, given, start, step=rk4_step, step_s=steps_s, substeps=len(steps_s))
        states[0] = next(marched)[:STATES]
        for sample, state in enumerate(marched, start=1):
            largest = np.maximum(largest, np.abs(state[3:]).max(axis=0))
            if sample < len(states):
                states[sample] = state[:STATES]
    states[..., ~(largest < LARGEST_SPEED)] = np.nan
    return states


def _raise_diverged(vessel: Vessel, primitives: Sequence[Primitive], environment: Environment) -> None:
    """Simulate one by one and raise the error of the first run that diverges."""
    for primitive in primitives:
        for heading in _headings(environment):
            current_b = np.array(to_body(environment.current_to, float(heading), NUMPY))
            simulate(
                vessel,
                primitive.commands,
                pose=(0.0, 0.0, float(heading)),
                velocity=primitive.entry_velocity + np.append(current_b, 0.0),
                environment=environment,
                standing=primitive.entry_inputs,
            )
    raise Diverged(f"vessel {vessel.name!r}: a regressor overflows under the commands of the dictionary")
