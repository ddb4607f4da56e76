"""Runs of craft without a rudder are named by what steers them, in the words of a bridge."""

from __future__ import annotations

import numpy as np
import pytest

from expdesign.importing import cut, family, presumed, sides
from expdesign.importing.mapping import Mapping, Use
from expdesign.importing.sampling import Sampled, Stretch
from expdesign.indices.read import orders
from expdesign.signals import Batch
from expdesign.simulation.helm import Helm
from logged_trial import Voyage, voyage

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def trips() -> dict[str, Voyage]:
    return {kind: voyage(parts=(("steady", 60.0), (kind, 200.0))).every(2) for kind in ("zigzag", "circle")}


def label(trip: Voyage, columns: dict[str, np.ndarray], side: dict[str, float] | None = None) -> str:
    """Of a run of the trip with other inputs that do what its rudder did."""
    stretch = Stretch(time_s=trip.time_s, columns=columns)
    ship = presumed([stretch], length_m=50.0, sample_time_s=0.2, bow=(), sides=side or {})
    names = tuple(name.removesuffix("_rps").removesuffix("_rad") for name in columns)
    order = [names.index(name) for name in ship.model.inputs]
    batch = Batch(
        name="a", sample_time_s=0.2, input_names=ship.model.inputs,
        inputs=np.stack(list(columns.values()), axis=1)[:, order],
        velocity=np.stack([trip.u_mps, trip.v_mps, trip.r_radps], axis=1),
        pose=np.stack([trip.north_m, trip.east_m, np.unwrap(trip.heading_rad)], axis=1),
    )  # fmt: skip
    return family(ship, batch)


def craft(trip: Voyage) -> dict[str, dict[str, np.ndarray]]:
    share, still = np.sin(trip.rudder_rad), np.zeros(len(trip.time_s))
    return {
        "rudder": {"n1_rps": still + 3.0, "rudder1_rad": trip.rudder_rad},
        "two propellers": {"n1_rps": 6.0 + 5.0 * share, "n2_rps": 6.0 - 5.0 * share},
        "azimuths": {
            "n1_rps": still + 5.0, "a1_rad": -trip.rudder_rad, "n2_rps": still + 5.0, "a2_rad": -trip.rudder_rad,
        },
        "one azimuth": {"n1_rps": still + 5.0, "a1_rad": -trip.rudder_rad},
    }  # fmt: skip


OUT_OF_USE = {
    "both engines": lambda n: n,
    "one stands still": lambda n: 0.0 * n,
    "one is dragged round": lambda n: 0.3 + 0.0 * n,
    "one is in another unit": lambda n: n / 60.0,
    "one feathers more the faster the other": lambda n: 0.1 * n + 0.2,
}


@pytest.mark.parametrize("kind", OUT_OF_USE)
def test_an_engine_that_is_out_of_use_all_the_time_steers_nothing(kind: str) -> None:
    parts = (("steady", 100.0), ("zigzag", 200.0), ("steady", 100.0), ("circle", 200.0), ("steady", 100.0))
    trip = voyage(parts=parts).every(10)
    engine = np.where(trip.time_s - trip.time_s[0] < 350.0, 4.0, 3.0)  # another speed for the circle
    columns = {
        "n1_rps": engine, "n2_rps": OUT_OF_USE[kind](engine), "rudder1_rad": trip.rudder_rad, "u_mps": trip.u_mps,
    }  # fmt: skip
    step_s = float(np.diff(trip.time_s).mean())
    found = Sampled(
        stretches=(Stretch(time_s=trip.time_s, columns=columns),), sample_time_s=step_s, notes=(), held_s={},
        channels={},
    )  # fmt: skip
    assert len(cut(found, length_m=50.0)) == 2


LABELS = {
    ("rudder", "zigzag"): "zig-zag 20/20 starboard",
    ("rudder", "circle"): "turning circle 35 starboard",
    ("two propellers", "zigzag"): "zig-zag 20 by differential thrust starboard",
    ("two propellers", "circle"): "turning circle by differential thrust starboard",
    ("azimuths", "zigzag"): "zig-zag 20/20 by azimuths starboard",
    ("azimuths", "circle"): "turning circle 35 by azimuths starboard",
    ("one azimuth", "zigzag"): "zig-zag 20/20 by azimuths starboard",
    ("one azimuth", "circle"): "turning circle 35 by azimuths starboard",
}


@pytest.mark.parametrize(("kind", "trial"), LABELS)
def test_a_standard_trial_is_named_with_what_steers(kind: str, trial: str, trips: dict[str, Voyage]) -> None:
    assert label(trips[trial], craft(trips[trial])[kind]) == LABELS[kind, trial]


def test_other_runs_are_named_by_the_inputs_that_change(trips: dict[str, Voyage]) -> None:
    trip = trips["zigzag"]
    wave, still = np.sin(trip.time_s / 7.0), np.zeros(len(trip.time_s))
    slow = 5.0 + np.round(2.0 * (trip.time_s - trip.time_s[0]) / np.ptp(trip.time_s))
    assert label(trip, {"n1_rps": slow, "n2_rps": slow}) == "changes of speed"
    assert label(trip, {"n1_rps": 5.0 + wave, "n2_rps": 5.0 - wave}) == "differential thrust"
    assert label(trip, {"n1_rps": slow + wave, "n2_rps": slow - wave}) == "differential thrust and speed"
    assert label(trip, {"n1_rps": slow, "a1_rad": 0.3 * wave}) == "azimuths and speed"
    assert label(trip, {"n1_rps": still + 5.0, "rudder1_rad": 0.3 * wave}) == "helm"


def test_names_tell_the_sides_of_thrusters() -> None:
    names = {
        "Thruster Port RPM": "n1_rps",
        "RPM_S": "reached_n2_rps",
        "motor 3 rpm": "n3_rps",
        "rudder port": "rudder1_rad",
    }
    uses = tuple(Use(file="a", channel=name, column=column) for name, column in names.items())
    assert sides(Mapping(uses=uses)) == {"n1": -1.0, "n2": 1.0}


@pytest.mark.parametrize("kind", ["rudder", "two propellers", "azimuths"])
def test_the_helm_is_read_from_inputs_as_it_was_given(kind: str, trips: dict[str, Voyage]) -> None:
    stretch = Stretch(time_s=trips["circle"].time_s, columns=craft(trips["circle"])[kind])
    helm = Helm(vessel=presumed([stretch], length_m=50.0, sample_time_s=0.2, bow=()))
    drive, angle = np.array([0.3, 0.5, 0.6, 0.4]), np.array([0.0, 0.2, -0.3, 0.4])
    read = orders(helm, helm.vessel.model.inputs, helm.rows(drive, angle))
    assert np.abs(read["helm_rad"] - angle).max() < 1e-12
