"""What sensors say goes into a diagnosis as it is: gaps are told and bridged, rates are not mixed, no cause lacks."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import Told, from_pose, hidden_record, hidden_records, vessel_of
from expdesign.diagnosis.accuracy import accuracy
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.causes.candidate import Situation
from expdesign.diagnosis.conclusions.findings import notes_on_data
from expdesign.diagnosis.data.sampled_batch import wind_held_over_gaps
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.motion.simulation import initial_states, simulate_windows
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.diagnosis.vessel_file.writing import extend
from expdesign.errors import InputError
from expdesign.signals import Record
from expdesign.vessel import Term, Vessel


def causes_of(vessel: Vessel, record: Record) -> dict[frozenset[str], set[str]]:
    """Which causes have a candidate with just these free effects."""
    ship = extended_model(vessel, record)
    situation = Situation(ship=ship, windows=cut_windows(ship.model, record))
    found: dict[frozenset[str], set[str]] = {}
    for cause in CAUSES:
        for candidate in cause.candidates(situation):
            found.setdefault(frozenset(candidate.free), set()).add(candidate.cause)
    return found


def test_a_late_heading_leaves_a_gyro_s_yaw_rate_alone_and_shifts_one_derived_from_it():
    record = hidden_record("barge", seed=1, batches=1, samples=120)
    derived = Record(batches=tuple(from_pose(batch) for batch in record.batches))
    for data, moves in ((record, False), (derived, True)):
        ship = extended_model(vessel_of("barge"), data)
        windows = cut_windows(ship.model, data)
        punctual, late = (
            simulate_windows(one, windows, initial_states(windows)).predicted
            for one in (ship, ship.with_effects({"late:psi": 2.0}))
        )
        assert np.array_equal(late[..., 2], punctual[..., 2]) != moves
        assert not np.array_equal(late[..., 3], punctual[..., 3])


def test_the_last_wind_seen_blows_on_from_where_it_blew():
    """A steady wind in the n-frame is known in the b-frame of any heading from one sample alone."""
    heading = np.linspace(0.3, 7.0, 40)
    c, s = np.cos(heading), np.sin(heading)
    air = np.stack([3.0 * c - 5.0 * s, -5.0 * c - 3.0 * s], axis=-1)
    seen = np.where(np.isin(np.arange(40), (7, 8, 30))[:, None], air, np.nan)
    np.testing.assert_allclose(wind_held_over_gaps(seen, heading), air, atol=1e-12)


def test_wind_that_falls_out_is_no_calm():
    """The second half of every run without wind costs little fit where the wind is steady, and is told."""
    record = hidden_record("tug", seed=2, batches=3, samples=200, wind=(8.0, 5.0))
    gappy = Record(
        batches=tuple(
            replace(batch, wind=np.where((np.arange(200) < 100)[:, None], batch.wind, np.nan))
            for batch in record.batches
        )
    )
    vessel = vessel_of("tug")
    whole, bridged = (accuracy(extended_model(vessel, data), data).fit for data in (record, gappy))
    assert (bridged > whole - 3.0).all()
    windows = cut_windows(extended_model(vessel, gappy).model, gappy)
    assert any(
        "The wind is missing in 50 % of the samples" in note for note in notes_on_data(vessel, gappy, windows, ())
    )


def test_depth_that_falls_out_is_no_deep_water():
    (record,) = hidden_records("barge", [Told()], seed=2, batches=2, samples=120, shoaling=True)
    gappy = Record(
        batches=tuple(
            replace(batch, depth_m=np.where(np.arange(120) < 60, batch.depth_m, np.nan)) for batch in record.batches
        )
    )
    windows = cut_windows(vessel_of("barge").model, gappy)
    assert windows.has_depth
    np.testing.assert_array_equal(windows.depth_m[0, 60:], record.batches[0].depth_m[59])
    blind = Record(batches=tuple(replace(batch, depth_m=np.full(120, np.nan)) for batch in record.batches))
    assert not cut_windows(vessel_of("barge").model, blind).has_depth


def test_batches_of_different_sample_times_are_refused():
    slow, fast = (hidden_record("barge", seed=1, batches=1, samples=100, step_s=step).batches[0] for step in (1.0, 0.5))
    with pytest.raises(InputError, match=r"different sample times, found 0\.5 s, 1 s"):
        cut_windows(vessel_of("barge").model, Record(batches=(slow, fast)))


def test_every_drag_of_the_air_is_sought_whichever_the_model_has():
    record = hidden_record("tug", seed=1, batches=2, samples=120)
    found = causes_of(vessel_of("tug", without=("W_abs_v_v", "W_uv")), record)
    assert found[frozenset({"theta:W_abs_u_u"})] == {"wind"}
    assert found[frozenset({"term:W_abs_v_v"})] == {"wind"}


def test_an_advance_loss_of_any_name_is_one_cause_and_no_other():
    vessel = vessel_of("coaster")
    terms = (*vessel.model.terms, Term("u", "X_loss", "u*abs(n1)*n1"))
    model = replace(
        vessel.model, terms=terms, parameters=np.append(vessel.model.parameters, -1e-4),
        parameter_std=np.append(vessel.model.parameter_std, 0.0),
    )  # fmt: skip
    found = causes_of(replace(vessel, model=model), hidden_record("coaster", seed=1, batches=2, samples=120))
    assert found[frozenset({"theta:X_loss"})] == {"thrust_advance_loss"}


def test_a_yaw_moment_of_thrust_that_the_file_has_is_an_asymmetry_and_no_parameter():
    record, vessel = hidden_record("barge", seed=1, batches=2, samples=120), vessel_of("barge")
    again, _ = extend(vessel, extended_model(vessel, record).with_effects({"asymmetry": 0.3}), {})
    found = causes_of(again, record)
    assert frozenset({"theta:N_tau_x"}) not in found
    assert found[frozenset({"asymmetry"})] == {"thruster_asymmetry"}
