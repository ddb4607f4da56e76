"""Whether a hold of a trial that is being sailed gives what its step was for."""

from __future__ import annotations

import numpy as np

from expdesign.step_trials.holds import Hold, Sailed, changed_words, commands_of
from expdesign.step_trials.live.step_list import Inputs, StepList
from expdesign.step_trials.live.values import Held
from expdesign.step_trials.samples import Plateau, plateau, step_sample
from expdesign.step_trials.tuning import TUNING


def plateau_of(held: Held, sample_time_s: float, steps: StepList) -> Plateau:
    """Mean of the rows since a hold has been steady."""
    assert held.steady is not None
    return plateau(_sailed(held, sample_time_s, steps), held.steady, len(held.rows))


def judged(
    held: Held, before: tuple[Inputs, Plateau] | None, sample_time_s: float, steps: StepList
) -> tuple[Plateau, str]:
    """Plateau of a hold, and why its step does not count; "" where it does, and for commands that are only gone to."""
    assert held.steady is not None
    assert held.inputs is not None
    batch = _sailed(held, sample_time_s, steps)
    after = plateau(batch, held.steady, len(held.rows))
    if held.step is None:
        return after, ""
    if held.gap_s:
        return after, f"a gap of {held.gap_s:.1f} s in the data"
    standing = steps.commands(held.inputs)
    known = steps.commands(before[0]) if before is not None else standing
    hold = Hold(
        number=held.step.number, batch=0, begin=0, settled=held.stands, end=len(held.rows),
        commands=(standing[0], standing[1]), changed=changed_words(held.changed),
        change=(standing[0] - known[0], standing[1] - known[1]), first=False,
    )  # fmt: skip
    free = (0.0, TUNING.most_delay_s)
    sample = step_sample(batch, hold, held.steady, after, before[1] if before else None, (free, free))
    return after, "; ".join(sample.problems)


def _sailed(held: Held, sample_time_s: float, steps: StepList) -> Sailed:
    u, v, r = np.array([row.motion for row in held.rows]).T
    inputs = np.array([row.inputs for row in held.rows])
    return Sailed(
        name="live", sample_time_s=sample_time_s, state=np.stack([np.hypot(u, np.nan_to_num(v)), r], axis=1), sway=v,
        commands=commands_of(steps.controls, steps.names, inputs), inputs=inputs,
    )  # fmt: skip
