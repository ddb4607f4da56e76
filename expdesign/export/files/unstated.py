"""What nobody stated and an estimate's data show, in sentences: of every file and page that the estimate goes into."""

from __future__ import annotations

import math

from expdesign.assessment import Answer, Assessment, Current, Moved
from expdesign.conventions import plus_minus
from expdesign.vessel import column_name


def unstated_sentences(found: Assessment) -> tuple[str, ...]:
    """A current, and inputs that the ship answers at another time than is stated: what they do to the estimates."""
    flow = () if found.current is None else (current_sentence(found.current),)
    return (*flow, *map(answer_sentence, found.answers))


def current_sentence(flow: Current) -> str:
    """What a current that nobody stated does to the estimates, and what helps."""
    toward_deg = math.degrees(math.atan2(flow.east_mps, flow.north_mps)) % 360
    speed = plus_minus(math.hypot(flow.north_mps, flow.east_mps), flow.std_mps)
    return (
        f"The data show a steady current of {speed} m/s towards {toward_deg:.0f} deg, or another push that keeps its "
        f"direction on the earth. It moves {_moved(flow.moved)} of estimates that know of none; "
        "expdesign estimate --unknown steady-current estimates it, too."
    )


def answer_sentence(answer: Answer) -> str:
    """What an input that the ship answers at another time does to the estimates, and what helps."""
    late, column = plus_minus(abs(answer.late_s), answer.std_s), column_name(answer.signal)
    when = "later" if answer.late_s > 0 else "sooner"
    unknown_s = max(0.5, round(2 * abs(answer.late_s), 1))
    return (
        f"The ship answers {column} {late} s {when} than recorded orders and vessel file say: dead times are rarely "
        "known, and an order may be up to one row older than the row that shows it. That moves "
        f"{_moved(answer.moved)}; [std] {answer.signal}_delay_s = {unknown_s:g} in the vessel file lets oe estimate "
        f"the time, too, and a measured position belongs under reached_{column}."
    )


def _moved(most: Moved) -> str:
    return f"{most.parameter} by {most.by_std:.0f} of its standard deviations"
