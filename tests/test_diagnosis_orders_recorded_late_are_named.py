"""Orders whose clock is behind that of the motion: a dead time below zero, which no actuator has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import diagnose
from expdesign.diagnosis.causes import Situation
from expdesign.diagnosis.causes.actuators import ACTUATOR_DELAY, LATE_ORDERS
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.motion.inputs import delivered_inputs
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.signals import Record
from expdesign.vessel import Response, Vessel

LATE_S = 2.0
RUDDER = 1


def with_late_orders(record: Record, samples: int, columns: slice = slice(None)) -> Record:
    """The same motion with the orders of some inputs recorded so much later."""

    def later(inputs: np.ndarray) -> np.ndarray:
        moved = inputs.copy()
        moved[samples:, columns] = inputs[:-samples, columns]
        moved[:samples, columns] = inputs[0, columns]
        return moved

    return Record(batches=tuple(replace(one, inputs=later(one.inputs)) for one in record.batches))


def with_dead_time(vessel: Vessel, delay_s: float) -> Vessel:
    """The vessel whose file states that actuators wait."""
    actuators = tuple(
        replace(one, responses=(Response(delay_s=delay_s),) * len(one.signals)) for one in vessel.model.actuators
    )
    return replace(vessel, model=replace(vessel.model, actuators=actuators))


def test_what_acts_before_its_record_is_delivered_as_it_was_ordered():
    """Whole samples and parts of them, of one group of inputs; the other is as recorded."""
    record = hidden_record("coaster", seed=2, batches=1, samples=60)
    ship = extended_model(vessel_of("coaster"), record)
    windows = cut_windows(ship.model, record)
    rows = record.batches[0].inputs[:, :, None]
    late = with_late_orders(record, 2, slice(RUDDER, None)).batches[0].inputs[:, :, None]
    for shift_s in (2.0, 1.75):
        given, finer = delivered_inputs(ship.with_effects({"lead:rudder": shift_s}), late, windows)
        wanted, _ = delivered_inputs(ship.with_effects({"delay:rudder": 2.0 - shift_s or 1e-9}), rows, windows)
        tail = round(2.0 * finer)
        np.testing.assert_allclose(given[:-tail, 0], np.repeat(rows, finer, axis=0)[:-tail, 0])
        np.testing.assert_allclose(given[:-tail, RUDDER], wanted[:-tail, RUDDER], atol=1e-7)


def test_a_dead_time_that_is_stated_is_first_found_shorter():
    """Orders can be late only by what is left of it: the two numbers are one."""
    record = hidden_record("coaster", seed=2, batches=2, samples=60)

    def offered(vessel: Vessel, effects: dict[str, float]) -> tuple[int, int]:
        ship = extended_model(vessel, record).with_effects(effects)
        situation = Situation(ship=ship, windows=cut_windows(ship.model, record))
        return len(ACTUATOR_DELAY.candidates(situation)), len(LATE_ORDERS.candidates(situation))

    plain, waiting = vessel_of("coaster"), with_dead_time(vessel_of("coaster"), 1.5)
    assert min(offered(plain, {})) > 0
    assert offered(plain, {"lead:all": 1.0}) == (0, 0)
    assert offered(plain, {"delay:all": 1.0}) == (0, 0)
    stated = extended_model(waiting, record).stated
    assert offered(waiting, {})[0] > 0 == offered(waiting, {})[1]
    gone = offered(waiting, dict.fromkeys(stated, 0.0))
    assert gone[1] > 0


@pytest.mark.parametrize(("samples", "named"), [(1, False), (2, True)])
def test_less_than_half_a_sample_is_how_a_record_is_read(samples: int, named: bool):
    """A rudder that acts 0.6 s later makes orders that are recorded 1 s late 0.4 s late, and 2 s late ones 1.4 s."""
    sailed = hidden_record("coaster", seed=7, batches=4, samples=150, effects={"delay_s": 0.6, "acts_on": 0b11})
    found = diagnose(vessel_of("coaster"), with_late_orders(sailed, samples), seed=0)
    sizes = [item.estimates[0] for item in found.findings if item.cause == "late_orders"]
    assert bool(sizes) is named
    assert all(abs(one.value - 1.4) < 3.0 * one.std for one in sizes)


@pytest.mark.parametrize(
    ("ship", "seeds"), [("coaster", range(1)), pytest.param("barge", range(10, 20), marks=pytest.mark.thorough)]
)
def test_late_orders_are_named_with_their_size(ship: str, seeds: range):
    """First, in every trial; sizes are within two standard errors in 95 % of them, and the file leaves them out."""
    held = 0
    for seed in seeds:
        record = with_late_orders(hidden_record(ship, seed=seed, batches=4, samples=150), round(LATE_S))
        found = diagnose(vessel_of(ship), record, seed=seed)
        assert found.findings[0].cause == "late_orders"
        (size,) = found.findings[0].estimates
        held += abs(size.value - LATE_S) <= 1.96 * size.std
        assert size.std < LATE_S / 4
        assert "Set the clock of the orders" in found.verdict
        assert found.extended.model.actuators == vessel_of(ship).model.actuators
        assert any("leaves out a delay below zero" in note for note in found.notes)
    assert held >= binom.ppf(0.001, len(seeds), 0.95)
