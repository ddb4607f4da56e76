"""Runs added to a trial raise the power of its diagnosis; the command writes it down, and refuses what does not fit."""

import json

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.foresight.added import Offers, of_one_manoeuvre, together
from expdesign.foresight.effects import joined
from short_examples import SHORTER, copied


def offers() -> Offers:
    """Two effects and one nuisance; a minute of `a` tells of the first, three of `b` of the second and of it less."""
    base = np.diag([4.0, 1.0, 1.0])
    a, b = np.diag([1.0, 3.0, 0.0]), np.diag([1.0, 1.5, 4.0])
    a[0, 1] = a[1, 0] = 1.0
    return Offers(
        names=("a", "b"),
        run_s=np.array([60.0, 180.0]),
        known=base,
        each=np.stack([a, b]),
        precision=np.eye(1),
        blocks=(np.array([0]), np.array([1])),
    )


def test_information_of_added_runs_is_a_schur_complement():
    found = offers().noncentralities(np.array([2.0, 1.0]))
    whole = np.diag([4.0 + 2 + 1 + 1, 1.0 + 6.0 + 1.5])
    whole[0, 1] = whole[1, 0] = 2.0
    assert found == pytest.approx([1.0 / np.linalg.inv(whole)[1, 1], 1.0 + 4.0])


def test_runs_of_one_manoeuvre_are_the_fewest_that_suffice():
    case, needed = offers(), np.array([7.0, 9.0])
    for effect, (runs, largest) in enumerate(of_one_manoeuvre(case, needed)):
        times = {}
        for q, name in enumerate(case.names):
            enough = [n for n in range(81) if case.noncentralities(n * np.eye(2)[q])[effect] >= needed[effect]]
            if enough:
                times[name] = enough[0] * case.run_s[q]
        assert runs is not None
        assert runs.time_s == pytest.approx(min(times.values()))
        assert runs.runs[0][0] == min(times, key=times.__getitem__)
        assert largest > needed[effect]
    assert of_one_manoeuvre(case, np.array([1e9, 1e9]))[0][0] is None


def test_all_together_suffices_and_no_run_of_it_is_idle():
    case, needed = offers(), np.array([7.0, 9.0])
    found = together(case, needed)
    assert found is not None
    counts = np.array([dict(found.runs).get(name, 0) for name in case.names], dtype=float)
    assert (case.noncentralities(counts) >= needed).all()
    for q in np.flatnonzero(counts):
        assert not (case.noncentralities(counts - np.eye(2)[q]) >= needed).all()
    assert together(case, np.array([1e9, 1.0])) is None


def test_joined_names_say_what_they_share_once():
    assert joined(["inertia_factor_u", "inertia_factor_v"]) == "inertia_factor_u/v"
    assert joined(["north_mps", "east_mps"]) == "north/east_mps"
    assert joined(["lag_all_s"]) == "lag_all_s"


@pytest.mark.thorough
def test_the_command_writes_probabilities_that_follow_from_their_noncentralities(tmp_path, capsys):
    from expdesign.foresight import power

    arguments = ["foresee", str(copied(tmp_path, "story", SHORTER["story"])), "--jobs", "1", "--no-cache", "--quiet"]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    found = json.loads((tmp_path / "out/foresee.json").read_text())
    assert found["effects"]
    for effect in found["effects"]:
        if effect["size"] is not None:
            again = float(power(effect["noncentrality"], effect["freedom"], effect["level"]))
            assert effect["power"] == pytest.approx(again)
    short = {item["cause"] for item in found["effects"] if (item["power"] or 1.0) < found["wanted_power"]}
    assert short == set(found["missed"])
    assert {item["cause"] for item in found["not_seen"]} >= {"shallow_water"}
    page = (tmp_path / "out/foresee.html").read_text()
    assert all(sentence[:40] in page for sentence in found["conclusions"])
    assert main([*arguments, "--plan", str(tmp_path / "none.json")]) == 2
    assert "none.json" in capsys.readouterr().err
