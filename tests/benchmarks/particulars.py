"""Published ships: their trials predicted from particulars alone, and after one circle and one speed are known.
Cards are in `ships/`, each with its sources. The ships are compared with what was measured where the card states it
(the model of KVLCC2, free running; top speeds of two boats), and otherwise with simulations of the ship's published
model, each written in `published_models.py`. The scatter of the factors was set with these ships, but for KCS, the
naval vessel and the car carrier, which were added later. Of these the naval vessel's number of rudders and thrust are
not published (two, and what holds the speed), nor the car carrier's rudder area (the least that DNV asks for).

    python tests/benchmarks/record.py particulars
    python tests/benchmarks/particulars.py speeds    # the last table alone, in 20 s
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import published_models as published
import published_trials as trials
from expdesign.particulars import Card, Nominal, Stated, Trial, nominal
from expdesign.scenario import load_card

SHIPS = Path(__file__).parent / "ships"
MODELS: dict[str, Callable[[], trials.Model]] = {
    "kvlcc2": published.kvlcc2_ship,
    "kcs": published.kcs,
    "seiun-maru": published.seiun_maru,
    "mariner": published.mariner,
    "s175": published.s175,
    "tanker-190k": published.tanker_190k,
    "esso-osaka-model": published.esso_osaka,
    "otter": published.otter,
    "naval-vessel": published.naval_vessel,
    "car-carrier": published.car_carrier,
}
MEASURED = ("kvlcc2-model", "albatross", "macginitie")
HARD = math.radians(35.0)
SHARES = (1.0, 0.7, 0.5, 0.3)
DIAMETER = "tactical_diameter_m"


@dataclass(frozen=True)
class Case:
    """A ship without what is known of her trials, and that."""

    card: Card
    values: tuple[Stated, ...]
    source: str


def case(name: str, model: trials.Model | None = None) -> Case:
    """A published ship, compared with a model of her: her own, where none is given."""
    card = load_card(SHIPS / f"{name}.toml")
    if name in MEASURED and model is None:
        return Case(replace(card, stated=()), card.stated, "measured")
    model = model or MODELS[name]()
    values = []
    speed = model.speed_mps
    sides = [trials.circle(model, speed=speed, helm_deg=helm) for helm in (35.0, -35.0)]
    for quantity in sides[0]:
        value = math.sqrt(sides[0][quantity] * sides[1][quantity])
        values.append(stated(Trial(kind="circle", speed_mps=speed, angle_rad=HARD), quantity, value))
    for degrees in (10.0, 20.0):
        trial = Trial(kind="zigzag", speed_mps=speed, angle_rad=math.radians(degrees))
        found = trials.zigzag(model, speed=speed, angle_deg=degrees)
        values += [stated(trial, quantity, value) for quantity, value in found.items()]
    return Case(replace(card, stated=()), tuple(values), "published model")


def stated(trial: Trial, quantity: str, value: float) -> Stated:
    return Stated(trial=trial, quantity=quantity, value=value, source=f"{trial.kind}.{quantity}")


def known_of(one: Case) -> tuple[Stated, ...]:
    """Advance and tactical diameter of one circle."""
    first = next((value.trial for value in one.values if value.trial.kind == "circle"), None)
    wanted = ("advance_m", "tactical_diameter_m")
    picked = {
        value.quantity: value for value in reversed(one.values) if value.trial == first and value.quantity in wanted
    }
    return tuple(picked.values())


def compared(found: Nominal, values: tuple[Stated, ...]) -> list[tuple[Stated, float, float]]:
    """Each value with the logarithm of predicted by true, and that by the standard deviation of the interval."""
    by_key = {(one.trial, one.quantity): one for one in found.predicted}
    rows = []
    for value in values:
        one = by_key.get((value.trial, value.quantity))
        if one is None:
            rows.append((value, math.inf, math.inf))
            continue
        if not math.isfinite(one.value):  # she does not come to the end of it, as some of the drawn ships
            rows.append((value, math.inf, 0.0 if one.low <= value.value else math.inf))
            continue
        error = math.log(one.value / value.value)
        end = one.low if error > 0 else one.high
        half = abs(math.log(one.value / end)) if math.isfinite(end) else math.inf
        rows.append((value, error, 1.96 * error / half))
    return rows


def studied(names: tuple[str, ...] = (*MEASURED, *MODELS)) -> dict[str, tuple[Case, list, list]]:
    """Name -> case, comparison from particulars alone, and of the other values after one circle and one speed."""
    result = {}
    for name in names:
        one = case(name)
        also = tuple(dict.fromkeys(value.trial for value in one.values))
        alone = compared(nominal(one.card, also=also), one.values)
        known = known_of(one)
        after = []
        if known:
            fitted = nominal(replace(one.card, stated=known), also=also)
            after = compared(fitted, tuple(value for value in one.values if value not in known))
        result[name] = (one, alone, after)
    return result


def scaled_by_others(result: dict) -> list[float]:
    """Deviations by the standard deviation of the intervals, scaled by what the other ships show (leave one out)."""
    own = {name: np.array([z for _, _, z in alone if math.isfinite(z)]) for name, (_, alone, _) in result.items()}
    out = []
    for name, values in own.items():
        others = np.concatenate([other for key, other in own.items() if key != name])
        out += (values / math.sqrt(float(np.mean(others**2)))).tolist()
    return out


def summary(rows: list) -> tuple[int, int, float]:
    """Values, how many within 95 %, and the median size of the error in per cent."""
    inside = sum(abs(z) <= 1.96 for _, _, z in rows)
    sizes = [math.expm1(abs(error)) if math.isfinite(error) else math.inf for _, error, _ in rows]
    return len(rows), inside, 100 * float(np.median(sizes)) if sizes else math.nan


def speed_scaling() -> list[tuple[str, float, tuple[float, float], float, float]]:
    """Ship, share of speed, tactical diameters by length: of her MMG model to both sides, and of two vessels.

    One vessel is of particulars alone, the other fitted to one circle at full speed, the mean of both sides.
    """
    rows = []
    for name in ("kvlcc2", "seiun-maru", "kcs"):
        one, model = case(name), MODELS[name]()
        also = tuple(Trial(kind="circle", speed_mps=share * model.speed_mps, angle_rad=HARD) for share in SHARES)
        cards = one.card, replace(one.card, stated=known_of(one))
        alone, fitted = (
            {p.trial: p.value / model.length_m for p in nominal(card, also=also).predicted if p.quantity == DIAMETER}
            for card in cards
        )
        for share, trial in zip(SHARES, also, strict=True):
            starboard, port = (
                trials.circle(model, speed=trial.speed_mps, helm_deg=helm)[DIAMETER] / model.length_m
                for helm in (35.0, -35.0)
            )
            rows.append((name, share, (starboard, port), alone[trial], fitted[trial]))
    return rows


def show_speed_scaling() -> None:
    """The table; an entry's two deviations are those from starboard and port turns of the MMG model."""
    print("\nTactical diameter by length at shares of full speed, of her MMG model to starboard and port, of the")
    print("vessel of particulars alone, and of the vessel fitted to one circle at full speed:")
    head("ship", "share of full speed", "MMG", "particulars alone", "apart", "one circle known", "apart")
    for name, share, sides, alone, fitted in speed_scaling():
        apart = [", ".join(f"{mine / side - 1:+.0%}" for side in sides) for mine in (alone, fitted)]
        truth = ", ".join(f"{side:.2f}" for side in sides)
        print(f"| {name} | {share:.0%} | {truth} | {alone:.2f} | {apart[0]} | {fitted:.2f} | {apart[1]} |")


HEADS = (
    "ship", "values", "within 95 %", "median error", "after one circle and one speed: values", "within 95 %",
    "median error", "compared with",
)  # fmt: skip


def head(*names: str) -> None:
    print(f"\n| {' | '.join(names)} |\n|{'---|' * len(names)}")


def main() -> None:
    began = time.time()
    result = studied()
    head(*HEADS)
    for name, (one, alone, after) in result.items():
        print(f"| {name} | {cells(alone)} | {cells(after)} | {one.source} |")
    every = [row for _, alone, _ in result.values() for row in alone]
    rest = [row for _, _, after in result.values() for row in after]
    print(f"| all | {cells(every)} | {cells(rest)} | |")
    square = np.mean([row[2] ** 2 for row in every if math.isfinite(row[2])])
    share = np.mean(np.abs(scaled_by_others(result)) <= 1.96)
    print(f"\nMean square of deviations by their standard deviation: {square:.2f}. With intervals scaled by what the")
    print(f"other ships show, {share:.0%} of the values are within 95 %.")
    head("quantity", "values", "within 95 %", "median error", "bias")
    for quantity in dict.fromkeys(value.quantity for value, _, _ in every):
        rows = [row for row in every if row[0].quantity == quantity]
        bias = float(np.median([error for _, error, _ in rows]))
        print(f"| {quantity} | {cells(rows)} | {100 * math.expm1(bias):+.0f} % |")
    show_speed_scaling()
    print(f"\n{time.time() - began:.0f} s.")


def cells(rows: list) -> str:
    count, inside, error = summary(rows)
    return f"{count} | {inside} ({inside / count:.0%}) | {error:.0f} %" if count else "- | - | -"


if __name__ == "__main__":
    show_speed_scaling() if sys.argv[1:] == ["speeds"] else main()
