"""Runs are left out of a drafted day, and put in, one at a time, and the others stay where they are."""

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from expdesign.plan import PlanSettings
from expdesign.plan.drafts import another_in_leg, find_legs, redrafted
from expdesign.plan.solve import draft_trial
from expdesign.plan.values import Leg, Placement, PlanProblem
from expdesign.progress import silent
from expdesign.shortest_day.drafting import Drafting
from expdesign.shortest_day.more_runs import with_more
from expdesign.shortest_day.prices import DraftedDay
from expdesign.simulation import CALM
from plan_case import acceleration, area, ship

pytestmark = pytest.mark.usefixtures("undrawn")

TOLD = {"much": 5.0, "little": 1.0, "less": 0.5}
NAMES = tuple(TOLD)
NEEDED = 6.5
TAKES_S = {"much": 60, "little": 60, "less": 60}


@dataclass(frozen=True)
class FewDraft:
    """What is read of a draft."""

    sailed: SimpleNamespace
    made_good_m: np.ndarray
    late_s: np.ndarray
    room: SimpleNamespace
    transit_mps: float = 1.0
    direct_s: float = 0.0
    area: None = None
    water: None = None


def of_runs(*counts: int) -> SimpleNamespace:
    limits = SimpleNamespace(least_s={}, most_s={}, required=frozenset())
    return SimpleNamespace(
        problem=SimpleNamespace(names=NAMES, run_s=np.full(3, 60.0), constraints=limits), repeats=counts
    )


@pytest.mark.thorough
def test_other_runs_and_their_legs_stay_as_they_are():
    vessel = ship()
    problem = PlanProblem(
        vessel=vessel,
        area=area(shapely.box(-500, -500, 900, 900)),
        environment=CALM,
        settings=PlanSettings(),
        primitives=(acceleration(vessel, speed_mps=1.0),),
        design=SimpleNamespace(problem=SimpleNamespace(names=("go",)), repeats=(2,)),
        start=np.zeros(3),
        goal=np.array([400.0, 200.0, 0.0]),
    )
    draft = draft_trial(problem)
    places = draft.sailed.placements
    begins = [draft.sailed.trajectory.pose[leg.first] for leg in draft.sailed.legs if leg.kind == "primitive"]
    np.testing.assert_allclose(begins, [placed.pose for placed in places], atol=0.03)
    assert len(draft.known) == 3
    both = redrafted(problem, draft, places)
    assert both is not None
    assert len(draft.known) == 3  # nothing is sought where all stays
    assert np.array_equal(both.sailed.commands.values, draft.sailed.commands.values)
    one = replace(problem, design=SimpleNamespace(problem=problem.design.problem, repeats=(1,)))
    alone = redrafted(one, draft, places[:1])
    assert alone is not None
    assert len(draft.known) == 3 + 1  # the leg past the second run is the only one sought
    find_legs(problem, draft, [places[:1], places[1:], places[1:]])
    assert len(draft.known) == 3 + 2  # the leg past the first is sought once
    kept = both.sailed.legs[1].last
    assert np.array_equal(alone.sailed.commands.values[:kept], both.sailed.commands.values[:kept])
    assert [leg.kind for leg in alone.sailed.legs] == ["reposition", "primitive", "reposition"]
    assert alone.sailed.trajectory.pose[-1, :2] == pytest.approx(problem.goal[:2], abs=0.03)
    assert alone.sailed.day_s < both.sailed.day_s
    placed = {leg: another_in_leg(problem, draft, leg, 0) for leg in range(3)}
    leg, (run, more_s) = min(((k, one) for k, one in placed.items() if one is not None), key=lambda one: one[1][1])
    three = replace(problem, design=SimpleNamespace(problem=problem.design.problem, repeats=(3,)))
    more = redrafted(three, draft, [*places[:leg], run, *places[leg:]])
    assert more is not None
    assert len(draft.known) == 3 + 2 + 2  # the legs to the new run and on from it
    assert more.sailed.day_s - both.sailed.day_s == pytest.approx(more_s, rel=0.2)


def day_of(runs: list[str], *, takes_s: dict[str, int] = TAKES_S, needed: float = NEEDED) -> DraftedDay:
    """A day in which every leg takes 10 s and tells a fifth of a unit."""
    kinds = [part for name in runs for part in (("reposition", name), ("primitive", name))] + [("reposition", "goal")]
    lengths = [takes_s[name] if kind == "primitive" else 10 for kind, name in kinds]
    ends = np.cumsum([0, *lengths]).tolist()
    legs = tuple(Leg(kind=k, name=n, first=a, last=b) for (k, n), a, b in zip(kinds, ends, ends[1:], strict=False))
    told = np.array([TOLD[name] if kind == "primitive" else 0.2 for kind, name in kinds])
    places = tuple(Placement(primitive=name, pose=np.zeros(3)) for name in runs)
    sailed = SimpleNamespace(legs=legs, legs_s=np.array(lengths, dtype=float), day_s=float(ends[-1]), placements=places)
    footprints = [SimpleNamespace(name=name, duration_s=takes_s[name], displacement_m=0.0) for name in set(runs)]
    room = SimpleNamespace(space=SimpleNamespace(footprints=footprints))
    draft = FewDraft(sailed=sailed, made_good_m=np.zeros(len(legs)), late_s=np.zeros(len(legs)), room=room)
    repeats = tuple(runs.count(name) for name in NAMES)
    return DraftedDay(
        repeats=repeats, draft=draft, information=told[:, None, None], margin=float(np.log(told.sum() / needed))
    )


@pytest.mark.parametrize(("required", "left"), [((), ["much", "little"]), (("less",), ["much", "little", "less"])])
def test_as_many_runs_are_left_out_as_the_accuracy_allows(monkeypatch, required, left):
    """Of 5, 1, 1 and 0.5 units in runs, and a fifth in each leg, the least go."""
    accuracy = SimpleNamespace(margin=lambda M: float(np.log(M[0, 0] / NEEDED)))
    design = of_runs(1, 2, 1)
    design.problem.constraints.required = frozenset(required)
    drafting = Drafting(problem=SimpleNamespace(design=design), accuracy=accuracy)
    monkeypatch.setattr("expdesign.shortest_day.drafting.find_legs", lambda *_: None)
    monkeypatch.setattr("expdesign.shortest_day.drafting.redrafted", lambda _, draft, places: places)
    monkeypatch.setattr(Drafting, "_of", lambda self, repeats: None)
    monkeypatch.setattr(Drafting, "_judged", lambda self, repeats, places: day_of([one.primitive for one in places]))
    begun = day_of(["much", "little", "less", "little"])
    found, short = drafting.without_spare_runs(begun, 0.0)
    assert found.repeats == tuple(left.count(name) for name in NAMES)
    assert found.margin >= 0
    assert drafting.without_spare_runs(found, 0.0)[0] is found
    assert all(day.margin < 0 and day.day_s < begun.day_s for day in short)


@pytest.mark.parametrize(
    ("begun", "needed"),
    [
        (["much", "little", "less"], 6.7),  # "little" has to go, and "less" to be done twice
        (["much", "less"], 6.5),  # falls short: "less" twice
        (["much", "little"], 6.5),  # nothing is shorter
        (["little", "less"], 1.7),  # "less" is enough, alone and twice
    ],
)
def test_no_day_of_such_runs_is_shorter_than_the_one_found(monkeypatch, begun, needed):
    """Of all days with runs of the same kinds."""
    takes_s = {"much": 60, "little": 20, "less": 12}
    module = "expdesign.shortest_day.drafting"

    def day(names):
        return day_of(names, takes_s=takes_s, needed=needed)

    def another(problem, draft, leg, run):
        names = [item.primitive for item in draft.sailed.placements]
        names.insert(leg, draft.room.space.footprints[run].name)
        return Placement(primitive=names[leg], pose=np.zeros(3)), takes_s[names[leg]] + 10.0

    monkeypatch.setattr(f"{module}.find_legs", lambda *_: None)
    monkeypatch.setattr("expdesign.shortest_day.more_runs.another_in_leg", another)
    monkeypatch.setattr(f"{module}.redrafted", lambda _, draft, places: [one.primitive for one in places])
    monkeypatch.setattr(Drafting, "_of", lambda self, repeats: self.problem)
    monkeypatch.setattr(Drafting, "_judged", lambda self, repeats, names: day(names))
    accuracy = SimpleNamespace(margin=lambda M: float(np.log(M[0, 0] / needed)))
    drafting = Drafting(problem=SimpleNamespace(design=of_runs(0, 0, 0)), accuracy=accuracy)
    found = drafting.shortest_near(day(begun), 0.0)
    assert found.margin >= 0
    others = [day(list(runs)) for n in range(1, 6) for runs in combinations_with_replacement(sorted(set(begun)), n)]
    assert found.day_s == min(other.day_s for other in others if other.margin >= 0)


@pytest.mark.parametrize(("fullest", "kept"), [(False, [8, 4, 2, 4, 2]), (True, [8, 4, 4])])
def test_spare_runs_go_at_once_and_all_days_are_as_late_as_the_one_that_trials_are_drawn_of(monkeypatch, fullest, kept):
    """A day of 8 runs that falls short, and twice one of 4 that reaches the accuracy with 2."""
    days_of = {8: ["less"] * 8, 4: ["much", "little", "less", "little"]}
    drafting = Drafting(
        problem=SimpleNamespace(design=of_runs(1, 2, 1), settings=SimpleNamespace(draft=False)),
        accuracy=SimpleNamespace(margin=lambda M: float(np.log(M[0, 0] / NEEDED))),
        fullest=fullest,
    )
    drawn = []

    def lateness_s(problem, water, sailed):
        drawn.append(sailed)
        return 0.1 * sailed.legs_s

    module = "expdesign.shortest_day.drafting"
    monkeypatch.setattr(f"{module}.find_legs", lambda *_: None)
    monkeypatch.setattr(f"{module}.redrafted", lambda _, draft, places: [one.primitive for one in places])
    monkeypatch.setattr(f"{module}.draft_trial", lambda problem, *, like, progress: days_of[problem])
    monkeypatch.setattr(f"{module}.drawn_lateness_s", lateness_s)
    monkeypatch.setattr(f"{module}.replace", lambda problem, **_: problem)
    monkeypatch.setattr(Drafting, "_of", lambda self, repeats: sum(repeats))
    monkeypatch.setattr(Drafting, "_judged", lambda self, repeats, names: day_of(names))
    monkeypatch.setattr(f"{module}.with_more", lambda *_: None)
    days: list[DraftedDay] = []
    for repeats in ((0, 0, 8), (1, 2, 1), (1, 2, 1)):
        days = drafting.with_another(days, repeats, silent)
    assert [sum(day.repeats) for day in days] == kept
    assert len(drawn) == 1
    late_s = [0.1 * days[0].day_s / 8 * sum(day.repeats) for day in days]
    assert [day.expected_s - day.day_s for day in days] == pytest.approx(late_s)


def test_days_near_one_that_no_drawn_trial_ends_are_not_taken_to_be_in_time(monkeypatch):
    """Nor is another day taken to be as late: trials are drawn of it."""
    drafting = Drafting(
        problem=SimpleNamespace(design=of_runs(1, 2, 1), settings=SimpleNamespace(draft=False)),
        accuracy=SimpleNamespace(margin=lambda M: float(np.log(M[0, 0] / NEEDED))),
    )
    late_s = iter([np.inf, 1.0])
    module = "expdesign.shortest_day.drafting"
    monkeypatch.setattr(f"{module}.find_legs", lambda *_: None)
    monkeypatch.setattr(f"{module}.redrafted", lambda _, draft, places: [one.primitive for one in places])
    monkeypatch.setattr(f"{module}.draft_trial", lambda *_, **__: ["much", "little", "less", "little"])
    monkeypatch.setattr(
        f"{module}.drawn_lateness_s", lambda problem, water, sailed: np.full(len(sailed.legs), next(late_s))
    )
    monkeypatch.setattr(f"{module}.replace", lambda problem, **_: problem)
    monkeypatch.setattr(Drafting, "_of", lambda self, repeats: self.problem)
    monkeypatch.setattr(Drafting, "_judged", lambda self, repeats, names: day_of(names))
    monkeypatch.setattr(f"{module}.with_more", lambda *_: None)
    days = drafting.with_another([], (1, 2, 1), silent)
    assert [day.expected_s for day in days] == [np.inf]
    days = drafting.with_another(days, (1, 2, 1), silent)
    assert [sum(day.repeats) for day in days] == [4, 4, 2]
    assert [day.drawn for day in days] == [True, True, False]
    assert np.isfinite([day.expected_s for day in days[1:]]).all()


@pytest.mark.parametrize(
    ("most_s", "put_in"), [({}, "much"), ({"much": 119.0}, "little"), ({"much": 119.0, "little": 61.0}, None)]
)
def test_runs_that_limits_allow_no_more_of_make_no_day_good_and_leave_others_their_places(monkeypatch, most_s, put_in):
    """Of two manoeuvres only the better one is tried, of those that may be run once more."""
    monkeypatch.setattr("expdesign.shortest_day.more_runs.KINDS", 1)
    monkeypatch.setattr(
        "expdesign.shortest_day.more_runs.another_in_leg",
        lambda problem, draft, leg, run: (
            Placement(primitive=draft.room.space.footprints[run].name, pose=np.zeros(3)),
            70.0,
        ),
    )
    design = of_runs(1, 1, 0)
    design.problem.constraints.most_s = most_s
    accuracy = SimpleNamespace(margin=lambda M: float(np.log(M[0, 0] / NEEDED)))
    grown = with_more(SimpleNamespace(design=design), accuracy, day_of(["much", "little"], needed=7.0), 0.0)
    if put_in is None:
        assert grown is None
    else:
        assert grown is not None
        assert sorted(one.primitive for one in grown.placements) == sorted(["much", "little", put_in])
