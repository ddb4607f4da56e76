"""A small but truthful trial for the export tests: real primitives, a certified design, a simulated and checked track.

The ship follows the nominal model from rest to rest between an island and a shore; clearance and realised efficiency
are computed here from geometry and from the track's own information, not made up.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import shapely

from expdesign.conventions import to_n_frame
from expdesign.dictionary import PrimitiveSpec, build_dictionary
from expdesign.dictionary.build import family
from expdesign.dictionary.spec import complete_settings
from expdesign.durations import DurationDesign, build_durations, solve_durations
from expdesign.export.files import commands_csv, plan_json, track_csv
from expdesign.export.report import ReportContent
from expdesign.export.routes import PlannedTrack, planned_track
from expdesign.information import PrimitiveInformation, moments, regressor_rows, score_primitives
from expdesign.plan.values import Leg, Plan, Verification
from expdesign.sea_area import LocalFrame, SeaArea, as_multipolygon
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, Environment, simulate
from expdesign.vessel import (
    Actuator,
    Limit,
    Response,
    Vessel,
    VesselModel,
    commands_for,
    required_push,
    structure_terms,
)

PARAMETERS = (-0.05, -0.05, 1.0, 0.02, -0.2, -0.65, 0.02, -0.1, -0.0015, 0.0003)
CLEARANCE_M = 20.0
ENVIRONMENT = Environment(current_std_mps=0.05)
START = np.array([0.0, 0.0, 0.0])


def tug(*, sample_time_s: float = 1.0) -> Vessel:
    """A 30 m ship that takes generalised forces."""
    limits = (Limit(low=-30, high=30), Limit(low=-20, high=20), Limit(low=-120, high=120))
    responses = (Response(rate=10), Response(rate=10), Response(rate=60))
    model = VesselModel(
        terms=structure_terms("manoeuvring-10"),
        parameters=np.array(PARAMETERS),
        parameter_std=0.2 * np.abs(PARAMETERS),
        form="discrete",
        sample_time_s=1.0,
        actuators=(Actuator(kind="force", number=1, limits=limits, responses=responses),),
    )
    return Vessel(name="Test tug", length_m=30.0, beam_m=10.0, draught_m=3.0, sample_time_s=sample_time_s, model=model)


def request(name: str, family_name: str, **settings: float) -> PrimitiveSpec:
    return PrimitiveSpec(name=name, family=family_name, settings=complete_settings(family(family_name), settings))


@cache
def scored() -> tuple[PrimitiveInformation, ...]:
    specs = (
        request("ahead", "acceleration", duration_s=60, speed_mps=3.0),
        request("zigzag", "zigzag", duration_s=80, speed_mps=2.0, yaw_rate_radps=0.03, period_s=40),
        request("circle", "turning_circle", duration_s=120, speed_mps=3.0, turn_speed_mps=2.2, yaw_rate_radps=0.05,
                entry_s=20),
        request("sway", "sway_zigzag", duration_s=80, sway_mps=0.5, period_s=40, speed_mps=1.0),
        request("stop", "deceleration", duration_s=60, speed_mps=3.0),
    )  # fmt: skip
    return score_primitives(tug(), build_dictionary(tug(), specs), environment=CALM)


@cache
def design() -> DurationDesign:
    return solve_durations(build_durations(scored(), tug().model.names, total_s=480.0))


def runs() -> tuple[str, ...]:
    """Every whole run of the design, the kinds taking turns."""
    counts = dict(zip(design().problem.names, design().repeats, strict=True))
    return tuple(name for turn in range(max(counts.values())) for name, count in counts.items() if count > turn)


@cache
def plan() -> Plan:
    commands, legs = _commands_and_legs()
    trajectory = simulate(tug(), commands, pose=START)
    area = _area(trajectory)
    clearance = _clearances(trajectory, area)
    return Plan(
        area=area,
        commands=commands,
        trajectory=trajectory,
        legs=legs,
        reposition_bound_s=0.0,
        leave_water_probability=None,
        design_efficiency_realised=_realised(commands, trajectory),
        verification=Verification(
            clearance_min_m=float(clearance.min()),
            clearance_time_s=float(clearance.argmin() * commands.sample_time_s),
            reproduction_error_m=0.0,
            limit_excess=0.0,
            problems=(),
        ),
    )


def unverified() -> Plan:
    failed = replace(plan().verification, problems=("the hull comes within 3.0 m of the rocks at 412 s",))
    return replace(plan(), verification=failed)


def _commands_and_legs() -> tuple[Commands, tuple[Leg, ...]]:
    """Each run as built, joined by course changes of 30 to 90 degrees at the next run's entry speed."""
    vessel, by_name = tug(), {item.primitive.name: item.primitive for item in scored()}
    pieces: list[np.ndarray] = []
    legs: list[Leg] = []
    velocity, inputs = np.zeros(3), np.zeros(3)

    def add(kind: str, name: str, values: np.ndarray) -> None:
        first = legs[-1].last if legs else 0
        pieces.append(values)
        path = {"path": "straight"} if kind == "reposition" else {}
        legs.append(Leg(kind=kind, name=name, first=first, last=first + len(values), **path))

    for number, name in enumerate((*runs(), "rest")):
        entry = by_name[name].entry_velocity if name in by_name else np.zeros(3)
        turn = 0.0 if name in ("ahead", "rest") else np.radians((60, 75, -50, 90, 40)[(number - 1) % 5])
        values = _joint(vessel, velocity, entry, turn=turn, before=inputs)
        add("reposition", name if name in by_name else "goal", values)
        if name in by_name:
            add("primitive", name, by_name[name].commands.values)
            velocity = by_name[name].exit_velocity
        inputs = pieces[-1][-1]
    values = np.concatenate(pieces)
    return Commands(sample_time_s=1.0, names=vessel.model.inputs, values=values), tuple(legs)


def _joint(
    vessel: Vessel, start: np.ndarray, end: np.ndarray, *, turn: float, before: np.ndarray, seconds: int = 60
) -> np.ndarray:
    share = np.linspace(0.0, 1.0, seconds + 1)[:, None]
    blend = share**2 * (3 - 2 * share)
    wished = start + blend * (end - start)
    wished[:, 2] += turn / seconds * (1 - np.cos(2 * np.pi * share[:, 0]))
    wished[:, 1] += -3.0 * wished[:, 0] * (wished[:, 2] - start[2] * (1 - blend[:, 0]) - end[2] * blend[:, 0])
    middles, rates = (wished[1:] + wished[:-1]) / 2, np.diff(wished, axis=0)
    force = np.array([required_push(vessel.model, nu, rate) for nu, rate in zip(middles, rates, strict=True)])
    return np.asarray(commands_for(vessel.model, force, sample_time_s=1.0, before=before))


def _area(trajectory: Trajectory) -> SeaArea:
    """Water around the track with land to the north and west, an island in the loop, and a shoal."""
    line = shapely.LineString(trajectory.pose[:, 1::-1])
    west, south, east, north = line.bounds
    sea = shapely.box(west - 220, south - 180, east + 260, north + 200)
    coast = shapely.Polygon(
        [(west - 220, south - 180), (west - 150, south), (west - 110, (south + north) / 2), (west - 60, north + 70),
         ((west + east) / 2, north + 120), (east + 260, north + 90), (east + 260, north + 200),
         (west - 220, north + 200)]
    )  # fmt: skip
    island = shapely.Point(180, 120).buffer(45).difference(line.buffer(45))
    shoal = shapely.box(east + 60, south - 60, east + 160, south + 40)
    land = as_multipolygon(shapely.union_all([coast, island]))
    water = as_multipolygon(sea.difference(land).difference(shoal))
    return SeaArea(
        name="Test sound",
        frame=LocalFrame(60.1, 24.9),
        water=water,
        land=land,
        depth_rule="A square shoal is forbidden; elsewhere the water counts as deep enough.",
        notes=("The coast was drawn by hand.",),
        source="drawn for a test, no licence needed",
    )


def _clearances(trajectory: Trajectory, area: SeaArea) -> np.ndarray:
    hulls = [shapely.Polygon(to_n_frame(tug().hull_b, pose)[:, ::-1]) for pose in trajectory.pose]
    return shapely.distance(area.water.boundary, np.array(hulls))


def _realised(commands: Commands, trajectory: Trajectory) -> float:
    names = tug().model.names
    X, Y = moments(tug().model, regressor_rows(tug().model, trajectory, commands, CALM), names)
    longer = commands.duration_s / design().problem.total_s
    return longer * float(np.exp((np.linalg.slogdet(X - Y @ Y.T)[1] - design().log_det) / len(names)))


def report_content(**changes: object) -> ReportContent:
    given: dict[str, object] = {
        "scenario": "test-sound",
        "vessel": tug(),
        "environment": ENVIRONMENT,
        "start": START,
        "goal": plan().trajectory.pose[-1],
        "criterion": "D",
        "fixed_parameters": (),
        "clearance_m": CLEARANCE_M,
        "confidence": 0.95,
        "information": scored(),
        "design": design(),
        "plan": plan(),
        "command": "expdesign run test-sound.toml",
    }
    return ReportContent(**(given | changes))


def plan_files(made: Plan | None = None) -> dict[str, str]:
    """The files of the plan, or of a variant of it."""
    made = made or plan()
    text = plan_json(made, scenario="test-sound", vessel=tug(), environment=ENVIRONMENT, clearance_m=CLEARANCE_M)
    return {"plan.json": text, "track.csv": track_csv(made), "commands.csv": commands_csv(made)}


def planned() -> PlannedTrack:
    return planned_track(plan(), scenario="test-sound", vessel=tug(), environment=ENVIRONMENT, clearance_m=CLEARANCE_M)
