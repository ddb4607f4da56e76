"""A plan is spoilt in one way at a time; the check must find each, and find nothing in the sound plan."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.plan.values import Leg, SailedTrial
from expdesign.plan.verify import (
    ENTRY_TOLERANCE,
    _end_problems,
    _entry_problems,
    _limit_excess,
    _speed_problems,
    _standing_problems,
    hull_clearance,
    verify_plan,
)
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM, simulate
from expdesign.vessel import Limit
from plan_case import area, primitive, ship

CLEARANCE_M = 20.0


def sound():
    """An acceleration from rest and minutes of slowing down to rest again, as a plan of two legs."""
    vessel = ship()
    run = primitive(vessel)
    last = run.commands.values[-1]
    slowing = last * np.clip(1 - np.arange(1, 101) / 20, 0, 1)[:, None]
    commands = replace(run.commands, values=np.vstack([run.commands.values, slowing]))
    track = simulate(vessel, commands)
    return {
        "vessel": vessel,
        "area": area(shapely.box(-100, -100, 100, 250)),
        "environment": CALM,
        "commands": commands,
        "trajectory": track,
        "legs": (
            Leg(kind="primitive", name="go", first=0, last=60),
            Leg(kind="reposition", name="goal", first=60, last=160),
        ),
        "clearance_m": CLEARANCE_M,
        "transit_mps": 1.3,
        "primitives": {"go": run},
        "repeats": {"go": 1},
        "start": np.zeros(3),
        "goal": track.pose[-1],
    }


def check(plan):
    plan = dict(plan)
    sailed = SailedTrial(**{name: plan.pop(name) for name in ("commands", "trajectory", "legs")})
    return verify_plan(plan.pop("vessel"), plan.pop("area"), plan.pop("environment"), sailed, **plan)


def bent(track: Trajectory, name: str, column: int, by: float) -> Trajectory:
    values = getattr(track, name).copy()
    values[80:120, column] += by
    return replace(track, **{name: values})


def changed(commands: Commands, row: int, column: int, by: float) -> Commands:
    values = commands.values.copy()
    values[row, column] += by
    return replace(commands, values=values)


def ramped(vessel, commands: Commands) -> Commands:
    """The first signal, raised from sample 60 on as fast as it may until it is beyond its limit."""
    limit, values = vessel.limits[0], commands.values.copy()
    climb = values[60, 0] + vessel.rates[0] * commands.sample_time_s * np.arange(len(values) - 60)
    values[60:, 0] = np.minimum(climb, 1.1 * limit.high)
    return replace(commands, values=values)


def turned_at_once(vessel, commands: Commands) -> Commands:
    """An azimuth that points backwards from the first sample on, though it takes seconds to turn there."""
    return changed_all(commands, vessel.model.inputs.index("a1"), np.pi)


def changed_all(commands: Commands, column: int, by: float) -> Commands:
    return replace(commands, values=commands.values + by * (np.arange(commands.values.shape[1]) == column))


def test_a_sound_plan_has_no_problems_and_its_true_clearance():
    found = check(sound())
    assert found.passed
    assert found.clearance_min_m == pytest.approx(85.0)  # 100 m astern of the origin, 15 m of hull
    assert found.reproduction_error_m < 1e-3


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda p: {"commands": changed(p["commands"], 70, 0, 3.0)}, "passes its rate"),
        (lambda p: {"commands": ramped(p["vessel"], p["commands"])}, "passes its limit"),
        (lambda p: {"commands": turned_at_once(p["vessel"], p["commands"])}, "passes its rate"),
        (lambda p: {"commands": changed(p["commands"], 30, 0, 0.5)}, "not the dictionary's"),
        (lambda p: {"commands": changed(p["commands"], -1, 0, 0.1)}, "at the goal, expected 0"),
        (lambda p: {"repeats": {"go": 2}}, "run 1 times"),
        (lambda p: {"repeats": {}}, "ask for 0"),
        (lambda p: {"legs": p["legs"][:1]}, "gaps"),
        (lambda p: {"legs": (replace(p["legs"][0], first=5), p["legs"][1])}, "gaps"),
        (lambda p: {"legs": (replace(p["legs"][0], last=59), p["legs"][1])}, "lasts 59 samples"),
        (lambda p: {"legs": (replace(p["legs"][0], name="come"), p["legs"][1])}, "no 'come'"),
        (lambda p: {"area": area(shapely.box(-100, -100, 100, 60))}, "forbidden water"),
        (lambda p: {"area": area(shapely.box(-30, -100, 23, 250))}, "required 20"),
        (lambda p: {"clearance_m": 90.0}, "required 90"),
        (lambda p: {"start": np.array([0.0, 5.0, 0.0])}, "off the start"),
        (lambda p: {"goal": p["goal"] + [0.0, 0.0, 0.1]}, "off the goal"),
        (lambda p: {"goal": p["goal"] + [3.0, 0.0, 0.0]}, "off the goal"),
        (lambda p: {"trajectory": bent(p["trajectory"], "pose", 2, 0.1)}, "heading"),
        (lambda p: {"trajectory": bent(p["trajectory"], "velocity", 1, 0.3)}, "speed"),
    ],
)
def test_each_flaw_is_named(spoil, word):
    plan = sound()
    found = check({**plan, **spoil(plan)})
    assert not found.passed
    assert any(word in problem for problem in found.problems), found.problems


def test_the_time_of_the_least_clearance_is_in_seconds_whatever_the_sample_time():
    """The same trial at half the sample time, in water that ends ahead of the goal."""
    plan = sound()
    plan["area"] = area(shapely.box(-100, -100, 100, plan["trajectory"].pose[:, 0].max() + 25.0))
    half = replace(plan["vessel"], sample_time_s=plan["vessel"].sample_time_s / 2.0)
    commands = replace(
        plan["commands"], values=np.repeat(plan["commands"].values, 2, axis=0), sample_time_s=half.sample_time_s
    )
    finer = {**plan, "vessel": half, "commands": commands, "trajectory": simulate(half, commands)}
    for found in (check(plan), check(finer)):
        (said,) = (problem for problem in found.problems if "from forbidden water" in problem)
        assert f"at {found.clearance_time_s:.0f} s, " in said
        assert found.clearance_time_s == pytest.approx(check(plan).clearance_time_s, abs=plan["vessel"].sample_time_s)


def test_a_shifted_track_does_not_pass_for_the_commands_motion():
    plan = sound()
    found = check({**plan, "trajectory": bent(plan["trajectory"], "pose", 1, 3.0)})
    assert any("off the track" in problem for problem in found.problems)


def test_the_hull_is_checked_where_the_commands_take_it_not_only_where_the_track_says():
    plan = sound()
    north = plan["trajectory"].pose[:, 0].max()
    plan["area"] = area(shapely.box(-100, -100, 100, north + 15 + 19.5))  # half a metre too near at the goal
    track = plan["trajectory"]
    drawn = replace(track, pose=track.pose - [[0.9, 0, 0]] * (track.pose[:, :1] > north - 2))
    assert check({**plan, "trajectory": drawn}).clearance_min_m == pytest.approx(19.5, abs=0.01)


def test_a_run_that_begins_at_the_wrong_speed_is_named():
    plan = sound()
    start = simulate(plan["vessel"], plan["commands"], velocity=(0.2, 0.0, 0.0))
    found = check({**plan, "trajectory": start})
    assert any("entry" in problem for problem in found.problems)


def test_a_ship_that_spins_at_the_goal_has_not_arrived():
    plan = sound()
    track = plan["trajectory"]
    spinning = (
        track.velocity + 0.05 * np.eye(3)[2] * (np.arange(len(track.velocity)) == len(track.velocity) - 1)[:, None]
    )
    found = check({**plan, "trajectory": replace(track, velocity=spinning)})
    assert any("off the goal" in problem and "turning at 0.05" in problem for problem in found.problems)


def test_clearance_counts_what_corners_swing_out_between_samples():
    vessel = ship()
    turn = np.pi / 3
    ends = np.array([[0.0, 0.0, -turn / 2], [0.0, 0.0, turn / 2]])
    between = np.linspace(-turn / 2, turn / 2, 201)[:, None] * [0.0, 0.0, 1.0]
    sea = area(shapely.box(-500, -500, 500, 20.0))
    said, exact = (
        hull_clearance(sea, Trajectory(sample_time_s=1.0, pose=pose, velocity=0 * pose), vessel.hull_b).min()
        for pose in (ends, between)
    )
    assert said <= exact < said + 0.5 * vessel.beam_m


def test_an_island_between_two_samples_is_not_jumped_over():
    vessel = ship()
    pose = np.array([[0.0, 0.0, 0.0], [200.0, 0.0, 0.0]])
    track = Trajectory(sample_time_s=1.0, pose=pose, velocity=np.zeros((2, 3)))
    sea = area(shapely.box(-500, -500, 500, 500).difference(shapely.box(-1, 99, 1, 101)))
    assert hull_clearance(sea, track, vessel.hull_b).min() < 0


def test_clearance_to_an_island_is_exact():
    vessel = ship()
    track = Trajectory(sample_time_s=1.0, pose=np.zeros((1, 3)), velocity=np.zeros((1, 3)))
    sea = area(shapely.box(-500, -500, 500, 500).difference(shapely.box(34.5, -5, 60, 5)))
    assert hull_clearance(sea, track, vessel.hull_b)[0] == pytest.approx(30.0)


@pytest.mark.parametrize("current", [(0.0, 0.0), (0.6, 0.0), (-0.6, 0.3)])
def test_legs_go_no_faster_through_water_than_stated_whatever_the_current(current):
    plan = sound()
    environment = replace(CALM, current_to=np.array(current))
    track = simulate(plan["vessel"], plan["commands"], velocity=(*current, 0.0), environment=environment)
    whole = Leg(kind="reposition", name="goal", first=0, last=160)  # from rest to 1 m/s and back, as a leg
    plan |= {"environment": environment, "trajectory": track, "legs": (whole,), "repeats": {}}
    fastest = np.hypot(*(track.velocity[:, :2] - current).T).max()  # headed north all the time
    slow, fast = (check({**plan, "transit_mps": share * fastest}) for share in (0.95, 0.99))
    named = [problem for problem in slow.problems if "through the water at" in problem]
    assert [problem.startswith("the leg to 'goal' goes") for problem in named] == [True, False]
    assert not any("through the water at" in problem and "goes" in problem for problem in fast.problems)


def test_runs_and_legs_from_faster_runs_may_be_faster_than_stated():
    plan = sound()
    assert check({**plan, "transit_mps": 0.5}).passed


@pytest.mark.parametrize(("low", "high", "span"), [(0.0, 5.0, 5.0), (-2.0, 3.0, 5.0), (-np.inf, np.inf, 2 * np.pi)])
def test_what_passes_a_limit_or_rate_counts_as_a_share_of_the_range(low: float, high: float, span: float) -> None:
    vessel = SimpleNamespace(limits=(Limit(low=low, high=high),), rates=np.array([0.7]))

    def excess(*values: float) -> tuple[float, str]:
        commands = Commands(sample_time_s=2.0, names=("n1",), values=np.array(values)[:, None])
        return _limit_excess(vessel, commands, np.array([1.0]))  # type: ignore[arg-type]

    assert excess(1.0, 2.3, 1.0) == (0.0, "")
    assert excess(1.0, 2.6, 1.3) == (pytest.approx(0.2 / span), "n1 passes its rate")
    if np.isfinite(high):
        for beyond in (high + 0.5, low - 0.5):
            assert excess(*np.linspace(1.0, beyond, 9)) == (pytest.approx(0.5 / span), "n1 passes its limit")


HEADING, CURRENT_TO = 0.6, np.array([0.4, -0.3])


def flowing() -> np.ndarray:
    """(3,) of a ship at rest in the current, along her axes."""
    c, s = np.cos(HEADING), np.sin(HEADING)
    north, east = CURRENT_TO
    return np.array([c * north + s * east, c * east - s * north, 0.0])


def moved(*velocities: np.ndarray) -> Trajectory:
    pose = np.tile([5.0, -7.0, HEADING], (len(velocities), 1))
    return Trajectory(sample_time_s=1.0, pose=pose, velocity=np.array(velocities))


def test_a_run_enters_with_its_velocity_through_the_water_in_any_current():
    entry, environment = np.array([1.0, 0.2, 0.05]), replace(CALM, current_to=CURRENT_TO)
    legs, runs = [Leg(kind="primitive", name="go", first=0, last=1)], {"go": SimpleNamespace(entry_velocity=entry)}
    fastest = flowing() + np.array([2.0, 1.0, 0.1])
    sound = moved(flowing() + entry, fastest)
    assert _entry_problems(environment, sound, legs, runs) == []  # type: ignore[arg-type]
    for column in range(3):
        off = 2.0 * ENTRY_TOLERANCE * abs(fastest[column])
        wrong = moved(flowing() + entry + off * np.eye(3)[column], fastest)
        (found,) = _entry_problems(environment, wrong, legs, runs)  # type: ignore[arg-type]
        assert f"begins {2.0 * ENTRY_TOLERANCE:.1%} off its entry" in found
    assert _entry_problems(environment, moved(entry, fastest), legs, runs)  # type: ignore[arg-type]


def test_a_plan_under_way_begins_as_she_moves_and_ends_at_rest_in_the_water():
    environment, begin = replace(CALM, current_to=CURRENT_TO), np.array([1.5, 0.1, 0.02])
    ends = (np.array([5.0, -7.0, HEADING]),) * 2

    def problems(*velocities: np.ndarray, under_way: np.ndarray | None) -> list[str]:
        return _end_problems(ship(), environment, moved(*velocities), ends, under_way)

    assert problems(begin, flowing(), under_way=begin) == []
    assert problems(flowing(), begin, flowing(), under_way=None) == []
    (late,) = problems(flowing(), begin, flowing(), under_way=begin)
    assert "off the start" in late
    (running,) = problems(begin, begin, under_way=begin)
    assert "off the goal" in running
    assert f"at {np.hypot(*(begin - flowing())[:2]):.3f} m/s through the water" in running


def test_what_answers_late_is_told_with_its_first_command_and_what_stood():
    late, prompt = SimpleNamespace(follows=False), SimpleNamespace(follows=True)
    vessel = SimpleNamespace(responses=(late, prompt))
    commands = Commands(sample_time_s=1.0, names=("n1", "n2"), values=np.array([[3.0, 4.0], [5.0, 6.0]]))
    (told,) = _standing_problems(vessel, commands, np.array([1.0, 1.0]))  # type: ignore[arg-type]
    assert told == "n1 is commanded 3 at once, expected 1 for a sample, as it answers late"
    assert _standing_problems(vessel, commands, np.array([3.0, 1.0])) == []  # type: ignore[arg-type]


@pytest.mark.parametrize("fast", [1, 2, 3])
def test_every_sample_within_a_leg_is_held_against_the_speed_of_legs(fast: int):
    """Its ends may be as fast as runs are."""
    environment, legs = replace(CALM, current_to=CURRENT_TO), [Leg(kind="reposition", name="goal", first=0, last=4)]
    ahead = np.array([1.0, 0.0, 0.0])

    def problems(*speeds: float) -> list[str]:
        return _speed_problems(environment, moved(*(flowing() + speed * ahead for speed in speeds)), legs, 1.2)

    assert problems(1.5, 1.4, 1.2, 1.3, 1.5) == []
    assert problems(1.0, 1.2, 1.2, 1.2, 1.0) == []
    speeds = np.where(np.arange(5) == fast, 1.5, 1.0)
    (found,) = problems(*speeds)
    assert f"goes 1.5 m/s through the water at {fast} s, stated 1.2 m/s" in found
