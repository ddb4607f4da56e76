"""From wide to narrow: the first trial of a ship of which little is known.

Where the standard deviations of the parameters are wide, runs as long as a dictionary asks for lead the ships of the
prior too far apart to be safe, or to come to the next run. The first trial then takes each run only as long as these
ships keep to its planned track, at a speed that they reach, and its legs are as slow and turn as wide as they need. Its
runs begin, and its goal is reached, less exactly than usual. What it tells narrows the prior, and `replan` goes on with
longer runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.dictionary import Primitive, PrimitiveSpec, build_primitive
from expdesign.errors import InputError, NoAnswer, NoPlan, Unreachable
from expdesign.plan.checked import may_be_verified
from expdesign.plan.control import HELM_SHARE, STEADY_HULLS, USABLE_SHARE, HelmShip, capability
from expdesign.plan.runs import dispersion_m
from expdesign.plan.solve import draft_trial, plan_drafted
from expdesign.plan.values import Plan, PlanProblem, PlanSettings
from expdesign.progress import Progress
from expdesign.scenario import Scenario
from expdesign.simulation.helm import Approach
from expdesign.values import Array
from expdesign.vessel import VesselModel
from expdesign.vessel.vessel import covering_discs

WIDE = 0.25  # median standard deviation of parameters, in their values, from which a prior is wide
NEAR_HULLS = 1.5  # hull lengths about the planned track that ships of the prior keep to in the runs of a first trial
KEPT = 0.9  # share of the ships that do
ABLE = 0.95  # share of the ships that reach the speed and the turning radius of legs
DRAWN = 200  # ships drawn of each run
CUT = (0.5, 0.9)  # least and most share of a run that is tried next
SHORTEST = 0.15  # share of a run below which it is left out
SPEEDS = 200  # between rest and top speed, at which the thrust of drawn ships is compared with their resistance
WIDEST = 8.0  # hull lengths of the turning radius of legs at most
SLOWER = (1.0, 0.8, 0.65, 0.5, 0.4, 0.33)  # shares of the speed of legs that are tried where ships turn wider
NEARLY = 0.9  # share of a turning radius by which a tighter one is not worth slower legs
STEPS = 20  # in the time of a hull length, of turns of drawn ships
ENGINE_GAIN = 3.0  # engine order, of full ahead, by the share of the speed that is missing in such turns
START_TOLERANCE = 3.0  # so many times less exactly than usual its runs begin, and its goal is reached
TIME_SHARE = 0.4  # of the scenario's informative time that a first trial takes


def is_wide(model: VesselModel) -> bool:
    """Whether the prior of the parameters is wide."""
    spread, size = model.drawn_std, np.abs(model.parameters)
    return bool(np.median(spread[size > 0] / size[size > 0]) >= WIDE) if (size > 0).any() else False


def whole_trial(problem: PlanProblem, progress: Progress) -> Plan | None:
    """The trial as asked for, or None where few drawn trials already say that it would be refused."""
    try:
        draft = draft_trial(problem, progress=progress)
        likely = problem.settings.draft or may_be_verified(problem, draft.water, draft.sailed)
        return plan_drafted(problem, draft, progress=progress) if likely else None
    except NoPlan:
        return None


def half_as_wide(case: Scenario) -> Scenario:
    """The scenario with half the standard deviations of parameters."""
    model = case.vessel.model
    unstated = {name: std / 2 for name, std in model.unstated_std.items()}
    halved = replace(model, parameter_std=model.parameter_std / 2, unstated_std=unstated)
    return replace(case, vessel=replace(case.vessel, model=halved))


def calibration(case: Scenario, *, seed: int) -> Scenario:
    """The scenario with each run cut to the time in which ships of the prior keep near its planned track.

    Raises:
        NoAnswer: no run is safe for so long that it tells anything, or too many ships of the prior make no way.
    """
    rng = np.random.default_rng((seed, len(case.dictionary)))
    plan = legs_for_most(case, rng)
    case = replace(case, plan=replace(plan, start_tolerance=max(plan.start_tolerance, START_TOLERANCE)))
    case = replace(case, dictionary=tuple(_slowed(spec, case.plan.transit_speed_mps) for spec in case.dictionary))
    cut = [spec for given in case.dictionary if (spec := _cut(case, given, rng)) is not None]
    if not cut:
        raise NoAnswer("the ships of the prior keep to the track of no run: state less uncertainty, or shorter runs")
    total_s = max(TIME_SHARE * case.design.total_s, max(_length_s(case, spec) for spec in cut))
    return replace(case, dictionary=tuple(cut), design=replace(case.design, total_s=total_s))


def _slowed(spec: PrimitiveSpec, most_mps: float | None) -> PrimitiveSpec:
    """The specification with speeds of at most so much, all of them by the same share."""
    speeds = _speeds(spec)
    fastest = max(speeds.values(), default=0.0)
    if most_mps is None or fastest <= most_mps:
        return spec
    return replace(spec, settings={**spec.settings, **{k: v * most_mps / fastest for k, v in speeds.items()}})


def _speeds(spec: PrimitiveSpec) -> dict[str, float]:
    return {name: value for name, value in spec.settings.items() if name.endswith("speed_mps") and value}


def legs_for_most(case: Scenario, rng: np.random.Generator) -> PlanSettings:
    """Settings with a speed and a turning radius of legs that most ships of the prior reach.

    The speed is that of full ahead on a straight course, or of the fastest run; the radius that of the helm as far over
    as legs use it. Where that radius is too wide, legs are as much slower as makes it tighter: thrust turns a slow ship
    on a tighter circle, a rudder hardly does. Where the file states a slower speed or a wider radius, that stays.

    Raises:
        NoAnswer: too many ships of the prior make no way at all.
    """
    vessel, plan = case.vessel, case.plan
    fastest_run = max((speed for spec in case.dictionary for speed in _speeds(spec).values()), default=np.inf)
    ship = capability(vessel, plan, current_mps=float(np.hypot(*case.environment.current_to)))
    if not isinstance(ship, HelmShip):
        return plan
    approach, drawn = ship.approach, vessel.model.drawn_parameters(DRAWN, rng)
    speeds = np.linspace(0.0, ship.top_speed_mps, SPEEDS)[:, None]
    ahead = approach.helm.inputs(1.0, approach.angle_rad)
    surge, _, _ = vessel.model.accelerations((speeds, 0.0, 0.0), (speeds, 0.0), ahead, parameters=drawn.T)
    fastest = float(np.quantile(speeds[np.maximum((surge > 0.0).sum(axis=0) - 1, 0), 0], 1.0 - ABLE))
    if fastest == 0.0:
        raise NoAnswer(
            f"{1 - ABLE:.0%} or more of the ships of the prior make no way with their engines full ahead: state less "
            "uncertainty of the parameters, or their ranges"
        )
    usual, widest_m = min(ship.transit_speed_mps, USABLE_SHARE * fastest, fastest_run), WIDEST * vessel.length_m
    radii_m = {  # that of a ship, as there is no mean with one that never turns
        share * usual: float(np.quantile(_turning_radii_m(approach, share * usual, drawn), ABLE, method="inverted_cdf"))
        for share in SLOWER
    }
    tight_m = max(widest_m, min(radii_m.values()) / NEARLY)
    speed, radius_m = next((speed, radius_m) for speed, radius_m in radii_m.items() if radius_m <= tight_m)
    return replace(plan, transit_speed_mps=speed, turning_radius_m=max(ship.turning_radius_m, min(radius_m, widest_m)))


def _turning_radii_m(approach: Approach, speed_mps: float, drawn: Array) -> Array:
    """(n,) radii of turns to the worse side at a surge speed that the engines hold, with the helm that legs use [m].

    Args:
        approach: of the nominal ship, at any speed.
        speed_mps: see above.
        drawn: (n, p) parameters of the ships.
    """
    helm, model = approach.helm, approach.helm.vessel.model
    over = HELM_SHARE * (helm.hardest(approach.drive) - abs(approach.angle_rad))
    angles = approach.angle_rad + np.repeat([over, -over], len(drawn))
    parameters, step_s = np.tile(drawn, (2, 1)).T, helm.vessel.length_m / speed_mps / STEPS
    motion = np.zeros((3, len(angles)))
    motion[0], order = speed_mps, approach.drive * speed_mps / approach.speed_mps
    with np.errstate(all="ignore"):  # some ships of a wide prior are beyond all bounds
        for _ in range(int(STEADY_HULLS * STEPS)):
            drive = np.clip(order + ENGINE_GAIN * (1.0 - motion[0] / speed_mps), 0.0, 1.0)
            inputs = tuple(helm.rows(drive, angles).T)
            rates = model.accelerations(tuple(motion), tuple(motion[:2]), inputs, parameters=parameters)
            motion = motion + step_s * np.stack(np.broadcast_arrays(*rates))
        radii = np.hypot(*motion[:2]) / np.abs(motion[2])
    return np.asarray(np.nan_to_num(radii, nan=np.inf).reshape(2, -1).max(axis=0))


def _length_s(case: Scenario, spec: PrimitiveSpec) -> float:
    return spec.settings["duration_s"] or build_primitive(case.vessel, spec).duration_s


def _cut(case: Scenario, spec: PrimitiveSpec, rng: np.random.Generator) -> PrimitiveSpec | None:
    """A specification that lasts as long as most ships keep near the track; None where that is too short."""
    vessel, share, whole_s = case.vessel, 1.0, _length_s(case, spec)
    while share >= SHORTEST:
        shorter = spec if share == 1.0 else _of_length(spec, share * whole_s, vessel.sample_time_s)
        near = _near(case, shorter, rng)
        if near >= 1.0:
            return shorter
        share *= np.clip(near, *CUT)
    return None


def _near(case: Scenario, spec: PrimitiveSpec, rng: np.random.Generator) -> float:
    """The share of a run in which most ships of the prior keep near its track; 0 where it cannot be run."""
    centres, _ = covering_discs(case.vessel.length_m, case.vessel.beam_m)
    try:
        item = build_primitive(case.vessel, spec)
        apart = dispersion_m(
            case.vessel, item, case.environment, centres_m=centres, confidence=KEPT, rng=rng, draws=DRAWN
        )
    except (NoPlan, InputError, Unreachable):
        return 0.0
    return float(np.flatnonzero(apart <= NEAR_HULLS * case.vessel.length_m)[-1] / (len(apart) - 1))


def _of_length(spec: PrimitiveSpec, length_s: float, sample_time_s: float) -> PrimitiveSpec:
    samples = max(2, int(length_s / sample_time_s))
    return replace(spec, settings={**spec.settings, "duration_s": samples * sample_time_s})


def first_note(runs: Sequence[Primitive], asked: Sequence[PrimitiveSpec]) -> str:
    """What a first trial is, in one sentence; runs that are slower than asked for are counted."""
    settings = {spec.name: spec.settings for spec in asked}
    slowed = sum(
        any(
            name.endswith("speed_mps") and value != settings[run.name].get(name) for name, value in run.settings.items()
        )
        for run in runs
        if run.name in settings
    )
    slower = f" ({slowed} of them slower than asked, for what most of these ships reach, or steer at)" if slowed else ""
    return (
        "a first trial: the standard deviations of the parameters are too wide for the runs asked for, so "
        f"{len(runs)} of {len(asked)} are taken{slower}, none longer than ships of the prior keep within "
        f"{NEAR_HULLS:g} hull lengths of the track. Legs are as slow and turn as wide as most of these ships need, and "
        f"runs may begin {START_TOLERANCE:g} times less exactly than usual. expdesign replan goes on with what it tells"
    )
