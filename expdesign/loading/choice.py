"""A load trial: its free parameters and what is known of them, the candidate loads, and the load cases chosen.

Every pair of a load and a manoeuvre is one primitive of a duration problem, so that shares, certificate and whole runs
are those of `durations`. Changing a load costs time, which shares do not see: loads are left out one by one, the least
missed first, as long as the D-efficiency stays high.

The information of a manoeuvre at a load is as efficient instruments would use it. The equation of roll, phi'' + alpha1
phi' + alpha2 phi - beta1 a_s - kappa1 r - gamma1 delta = e, has noise of the sensors with the spectrum

    S(w) = |i w + alpha1 + alpha2 / (i w)|^2 s_p^2 + beta1^2 s_s^2 + kappa1^2 s_r^2

of gyro, accelerometer and yaw-rate gyro, and of the moment of the waves that the vessel file states, as met at the
manoeuvre's mean speed on any course. Weighted by it, the noise-free signals x (k, 5) give X = sum_w x* x / S, and
J^T X J with the derivatives J of the coefficients by the parameters. What the model misses comes on top.

Source: doctoral thesis on grey-box identification of ship roll with few sensors, (5.17)-(5.24); L. Ljung, System
Identification (1999), 15.3, for the covariance of the best instruments.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.durations import Aim, DurationDesign, DurationProblem, optimal_shares, solve_durations
from expdesign.errors import InputError, NoAnswer, NotInformative
from expdesign.progress import Progress, silent
from expdesign.roll import (
    PARAMETERS,
    Direction,
    coefficients,
    cures,
    direction,
    named,
    open_directions,
    parameters,
    sensed_inertia,
)
from expdesign.roll.runs import LEAST_SAMPLES_PER_PERIOD
from expdesign.signals import AUXILIARY, Trajectory
from expdesign.simulation import rudder_angle, simulate
from expdesign.values import Array, sealed
from expdesign.vessel import NOMINAL, Load, RollPendulum, Vessel

RATE, ANGLE, READING = (AUXILIARY.index(name) for name in ("roll_rate_radps", "roll_rad", "imu_lateral_mps2"))


@dataclass(frozen=True, kw_only=True)
class LoadOption:
    """A load case that a trial may have."""

    name: str  # for reports
    load: Load | None  # on board; None for the one that is sought


def run_information(vessel: Vessel, theta: Array, option: LoadOption, primitives: Sequence[Primitive]) -> Array:
    """(q, 9, 9) information of one run of each manoeuvre at a load.

    Args:
        vessel: with a pendulum, and sensors with noise.
        theta: (9,) parameters, as believed; m and z_m of the unknown load among them.
        option: on board.
        primitives: manoeuvres, whose motion the load does not change.

    Raises:
        InputError: the sensors are without noise.
        NotInformative: there are too few samples in a period of roll, or the ship does not stay upright.
    """
    pendulum = _loaded(vessel, theta, option)
    _check(vessel, pendulum, option)
    ship = replace(vessel, pendulum=pendulum)
    found = coefficients(theta, pendulum.body, option.load)
    moments = np.array([_moments(ship, primitive, found.values) for primitive in primitives])
    return np.asarray(np.einsum("cp,qcd,de->qpe", found.jacobian, moments, found.jacobian))


def _loaded(vessel: Vessel, theta: Array, option: LoadOption) -> RollPendulum:
    assert vessel.pendulum is not None
    values = named(theta)
    load = Load(mass_kg=values["m"], z_m=values["z_m"]) if option.load is None else option.load
    own = {name: values[name] for name in vessel.pendulum.parameters}
    return replace(vessel.pendulum, load=load, parameters=own)


def _check(vessel: Vessel, pendulum: RollPendulum, option: LoadOption) -> None:
    sensors = vessel.sensors
    if not (sensors.roll_rate_radps > 0 and sensors.acceleration_mps2 > 0):
        raise InputError(
            f"vessel {vessel.name!r} has sensors without noise, expected sensors.roll_rate_radps and "
            "sensors.acceleration_mps2 above 0: they set the information of a run"
        )
    if not pendulum.righting_nm > 0:
        raise NotInformative(
            f"with {option.name} the ship does not stay upright: her metacentric height is "
            f"{pendulum.metacentric_height_m:.3g} m; leave this load out"
        )
    if pendulum.period_s / vessel.sample_time_s < LEAST_SAMPLES_PER_PERIOD:
        raise NotInformative(
            f"roll has a period of {pendulum.period_s:.3g} s with {option.name} and vessel.sample_time_s is "
            f"{vessel.sample_time_s:g}, expected {LEAST_SAMPLES_PER_PERIOD:g} samples or more in a period"
        )


def _moments(ship: Vessel, primitive: Primitive, values: Array) -> Array:
    """(5, 5) moments of one run."""
    commands = primitive.commands
    sailed = simulate(ship, commands, velocity=primitive.entry_velocity, standing=primitive.entry_inputs)
    assert sailed.auxiliary is not None
    rudder = rudder_angle(ship, commands, standing=primitive.entry_inputs)
    roll = sailed.auxiliary[:-1, [RATE, ANGLE, READING]]
    signals = np.column_stack([roll, -sailed.velocity[:-1, 2], -rudder])
    spectrum = np.fft.rfft(signals - signals.mean(axis=0), axis=0)[1:]
    frequency = np.asarray(2.0 * np.pi * np.fft.rfftfreq(len(signals), commands.sample_time_s)[1:], dtype=float)
    both = np.full(len(frequency), 2.0)  # positive and negative frequencies, but for the highest of an even number
    both[-1] = 1.0 if len(signals) % 2 == 0 else 2.0
    noise = _noise(ship, values, frequency) + _waves(ship, sailed, frequency)
    weight = both / noise / len(signals)
    return np.asarray(((spectrum.conj() * weight[:, None]).T @ spectrum).real)


def _noise(ship: Vessel, values: Array, frequency: Array) -> Array:
    """S(w) per sample."""
    alpha1, alpha2, beta, kappa, _ = values.tolist()
    of, w = ship.sensors, 1j * frequency
    rate = np.abs(w + alpha1 + alpha2 / w) ** 2 * of.roll_rate_radps**2
    return np.asarray(rate + (beta * of.acceleration_mps2) ** 2 + (kappa * of.yaw_rate_radps) ** 2)


def _waves(ship: Vessel, sailed: Trajectory, frequency: Array) -> Array:
    """(f,) per sample, of their moment over the inertia in the equation."""
    pendulum = ship.pendulum
    if pendulum is None or pendulum.waves is None:
        return np.zeros(len(frequency))
    speed = float(np.hypot(*sailed.velocity[:, :2].T).mean())
    of, body, load = pendulum.parameters, pendulum.body, pendulum.load
    inertia = sensed_inertia(of["A_x"], body, load, of["z_f"]) - of["K_vd"] * body.sensor(of["z_f"])
    slope = pendulum.waves.met_density(frequency, speed) * np.pi / sailed.sample_time_s
    return np.asarray((pendulum.righting_nm / inertia) ** 2 * slope)


# of a parameter's standard deviation, below which its value counts as zero; the deviation is then its size
SMALL_SHARE = 0.01
WEIGHED = ("m", "z_m")  # parameters of an unknown load


@sealed(theta="9", size="p", prior="p p")
class Question:
    """What is sought, from which ship with which loads."""

    vessel: Vessel  # with a pendulum
    options: tuple[LoadOption, ...]  # candidate loads, their names once each
    free: tuple[str, ...]  # names of the parameters sought
    theta: Array  # (9,) parameters, as believed
    size: Array  # (p,) of each free parameter, positive: its value, or its standard deviation where it is about zero
    prior: Array  # (p, p) information about relative changes, change over size, before the trial

    @property
    def places(self) -> list[int]:
        """Places of the free parameters among all."""
        return [PARAMETERS.index(name) for name in self.free]

    @property
    def generic(self) -> Array:
        """(9,) parameters, those about zero at their size, where the rank of equations is the usual one."""
        theta = np.array(self.theta)
        theta[self.places] = np.where(np.abs(theta[self.places]) < self.size, self.size, theta[self.places])
        return theta


def build_question(
    vessel: Vessel, loads: Sequence[Load | None], *, known: Mapping[str, float], guess: Mapping[str, float]
) -> Question:
    """The question of a vessel file with candidate loads.

    Args:
        vessel: its [roll] says what is known: parameters with a standard deviation are sought.
        loads: candidates; None for an unknown one.
        known: parameters that are known otherwise.
        guess: m and z_m of the unknown load, roughly.

    Raises:
        InputError: no [roll] is there, nothing is sought, the unknown load is not guessed, or one is too heavy or high.
    """
    pendulum = vessel.pendulum
    if pendulum is None:
        raise InputError(f"vessel {vessel.name!r} has no table [roll], expected a vessel file with one")
    weighed = None in loads
    for name in WEIGHED:
        if weighed and not guess.get(name):
            raise InputError(f"start.{name} is missing, expected a rough {name} of the unknown load")
    if weighed and not guess["m"] > 0:
        raise InputError(f"start.m is {guess['m']:g}, expected more than 0")
    unknown = Load(mass_kg=guess["m"], z_m=guess["z_m"]) if weighed else NOMINAL
    for load in loads:
        _check_on_board(vessel, pendulum.body.mass_kg, unknown if load is None else load)
    theta = parameters(**{**pendulum.parameters, **known, **({n: guess[n] for n in WEIGHED} if weighed else {})})
    std = {name: value for name, value in pendulum.parameter_std.items() if value > 0 and name not in known}
    free = tuple(name for name in PARAMETERS if name in std or (weighed and name in WEIGHED and name not in known))
    if not free:
        raise InputError(
            f"vessel {vessel.name!r} states no standard deviations of roll, expected [roll.parameter_std] for what the "
            "trial is to find"
        )
    at = np.abs(theta[[PARAMETERS.index(name) for name in free]])
    deviation = np.array([std.get(name, 0.0) for name in free])
    size = np.where(at > SMALL_SHARE * deviation, at, deviation)
    correlation = np.eye(len(free))
    for (one, other), value in pendulum.parameter_correlation.items():
        if one in free and other in free:
            i, j = free.index(one), free.index(other)
            correlation[i, j] = correlation[j, i] = value
    stated = np.flatnonzero(deviation)
    covariance = (correlation * np.outer(deviation / size, deviation / size))[np.ix_(stated, stated)]
    prior = np.zeros((len(free),) * 2)
    prior[np.ix_(stated, stated)] = np.linalg.inv(covariance)
    options = tuple(LoadOption(name=_name(load), load=load) for load in loads)
    names = [option.name for option in options]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two candidate loads are the same, {twice}, expected each once")
    return Question(vessel=vessel, options=options, free=free, theta=theta, size=size, prior=(prior + prior.T) / 2)


def _check_on_board(vessel: Vessel, own_kg: float, load: Load) -> None:
    """Raise where a load sinks the ship or floats above her."""
    if not load.mass_kg < own_kg:
        raise InputError(f"a load has {load.mass_kg:g} kg, expected less than the ship's own {own_kg:g} kg")
    if not abs(load.z_m) <= vessel.length_m:
        raise InputError(
            f"a load of {load.mass_kg:g} kg is at height {-load.z_m:g} m, expected within the length of the ship, "
            f"{vessel.length_m:g} m, of the line of the vessel file"
        )


def _name(load: Load | None) -> str:
    if load is None:
        return "the unknown load"
    return f"{load.mass_kg:g} kg at height {-load.z_m:g} m" if load.mass_kg else "the ship alone"


LEAST_EFFICIENCY = 0.9  # D-efficiency that a plan with fewer loads keeps, of the best with all candidates
BY_VOLUME = Aim()  # D: the volume of the confidence region of all parameters


@dataclass(frozen=True, kw_only=True)
class Step:
    """The best plan with so many loads."""

    options: tuple[int, ...]  # places of the loads among the candidates
    efficiency: float  # by the criterion, relative to all candidates
    smallest: float  # singular value of the relative sensitivity of their equations


@sealed(repeats="l q", std_before="p", std_after="p")
class LoadPlan:
    """Load cases of a trial."""

    question: Question  # that it answers
    manoeuvres: dict[str, float]  # names of the manoeuvres, each with a duration of one run [s]
    steps: tuple[Step, ...]  # from all candidate loads to the fewest that still determine all parameters
    chosen: Step  # the step that is followed
    # time shares over pairs of its loads and all manoeuvres, loads first, with certificate and whole runs
    design: DurationDesign
    repeats: Array  # (l, q) whole runs at each load of the step
    # std_before, std_after: (p,) standard deviations of the free parameters, infinite where nothing is known
    std_before: Array
    std_after: Array
    faintest: Direction  # the combination with the least information, relative standard deviation 1 / size


def choose_loads(
    question: Question,
    primitives: Sequence[Primitive],
    *,
    total_s: float,
    aim: Aim = BY_VOLUME,
    most_loads: int | None = None,
    progress: Progress = silent,
) -> LoadPlan:
    """Load cases, and the runs at each.

    Args:
        question: with the candidate loads.
        total_s: informative time, without changing loads.
        most_loads: at most so many load cases; None for the fewest that keep `LEAST_EFFICIENCY`.

    Raises:
        NotInformative: no load of the candidates tells a combination of the parameters, which is named.
        NoAnswer: the runs do not fit, or none with so few loads determines all parameters.
    """
    everything = tuple(range(len(question.options)))
    _check_rank(question, everything)
    pieces: list[Array] = []
    for option in question.options:
        progress(f"simulating with {option.name}", 0.4 * len(pieces) / len(everything))
        pieces.append(run_information(question.vessel, question.theta, option, primitives))
    scale = np.outer(question.size, question.size)
    matrices = np.array(pieces)[:, :, question.places][..., question.places] * scale
    of_loads = partial(_problem, question, primitives, matrices, total_s, aim)
    steps = _fewer(question, of_loads, everything, progress)
    chosen = _followed(question, steps, most_loads)
    progress("choosing whole runs", 0.95)
    design = solve_durations(of_loads(chosen.options))
    repeats = np.array(design.repeats).reshape(len(chosen.options), len(primitives))
    _check_runs(question, chosen, repeats, total_s)
    information = question.prior + np.einsum("lq,lqij->ij", repeats, matrices[list(chosen.options)])
    sizes, vectors = np.linalg.eigh(information)
    return LoadPlan(
        question=question,
        manoeuvres={item.name: item.duration_s for item in primitives},
        steps=steps,
        chosen=chosen,
        design=design,
        repeats=repeats,
        std_before=_std(question.prior) * question.size,
        std_after=_std(information) * question.size,
        faintest=direction(question.free, question.generic, vectors[:, 0], float(np.sqrt(max(sizes[0], 0.0)))),
    )


def _check_runs(question: Question, chosen: Step, repeats: Array, total_s: float) -> None:
    """Raise where the time is too short for a run with every load that is needed."""
    idle = [question.options[place].name for place, runs in zip(chosen.options, repeats, strict=True) if not runs.any()]
    if idle:
        raise NoAnswer(
            f"{total_s:g} s hold no whole run with {', '.join(idle)}; expected a longer design.total_s, shorter "
            "manoeuvres or fewer loads"
        )


def _std(information: Array) -> Array:
    """(p,) standard deviations; infinite where nothing is known."""
    known = np.diag(information) > 0
    result = np.full(len(information), np.inf)
    result[known] = np.sqrt(np.diag(np.linalg.inv(information[np.ix_(known, known)])))
    return result


def _problem(
    question: Question, primitives: Sequence[Primitive], matrices: Array, total_s: float, aim: Aim,
    options: Sequence[int],
) -> DurationProblem:  # fmt: skip
    """The duration problem of some of the loads; `matrices` are (o, q, p, p) of one run with each load."""
    run_s = np.array([item.duration_s for item in primitives])
    rate = matrices[list(options)] * (total_s / run_s)[:, None, None]
    rate = (rate + rate.swapaxes(-1, -2)) / 2
    names = [question.options[place].name for place in options]
    return DurationProblem(
        names=tuple(f"{item.name} with {name}" for name in names for item in primitives),
        parameters=question.free,
        mean_subtraction="none",
        matrices=rate.reshape(-1, *rate.shape[2:]),
        run_s=np.tile(run_s, len(names)),
        total_s=total_s,
        aim=aim,
        prior=question.prior,
    )


def _sensed(question: Question, options: Sequence[int]) -> tuple[Array, tuple[Direction, ...]]:
    assert question.vessel.pendulum is not None
    loads = [question.options[place].load for place in options]
    return open_directions(question.vessel.pendulum.body, question.generic, loads, question.free)


def _check_rank(question: Question, options: Sequence[int]) -> None:
    """Raise where the equations of all candidates together leave a combination open."""
    _, left = _sensed(question, options)
    if not left:
        return
    assert question.vessel.pendulum is not None
    loads = [question.options[place].load for place in options]
    better = cures(question.vessel.pendulum.body, question.generic, loads, question.free)
    helps = [one.what for one in better if one.rank == len(question.free)]
    advice = f"; what would: {'; or '.join(helps[:3])}" if helps else ""
    raise NotInformative(
        f"no candidate load determines {len(left)} combination{'s' * (len(left) > 1)} of the parameters: the data "
        f"would be the same if these changed together: {'; or: '.join(map(str, left))}{advice}",
        parameters=tuple(dict.fromkeys(name for one in left for name in one.change)),
    )


def _fewer(
    question: Question, of_loads: Callable[[Sequence[int]], DurationProblem], options: tuple[int, ...],
    progress: Progress,
) -> tuple[Step, ...]:  # fmt: skip
    """Steps from all loads down, each without the load that is missed least."""
    best = optimal_shares(of_loads(options)).certificate
    steps = [Step(options=options, efficiency=1.0, smallest=float(_sensed(question, options)[0][-1]))]
    while len(options) > 1:
        progress(f"leaving loads out, {len(options)} left", 0.4 + 0.5 / len(options))
        found = []
        for gone in options:
            rest = tuple(place for place in options if place != gone)
            sizes, left = _sensed(question, rest)
            if not left:
                gained = (optimal_shares(of_loads(rest)).certificate.value - best.value) / best.degree
                found.append(Step(options=rest, efficiency=float(np.exp(gained)), smallest=float(sizes[-1])))
        if not found:
            break
        steps.append(max(found, key=lambda step: step.efficiency))
        options = steps[-1].options
    return tuple(steps)


def _followed(question: Question, steps: Sequence[Step], most_loads: int | None) -> Step:
    if most_loads is None:
        return [step for step in steps if step.efficiency >= LEAST_EFFICIENCY][-1]
    few = [step for step in steps if len(step.options) <= most_loads]
    if not few:
        raise NotInformative(
            f"{most_loads} loads do not determine {', '.join(question.free)}; expected {len(steps[-1].options)} or more"
        )
    return few[0]
