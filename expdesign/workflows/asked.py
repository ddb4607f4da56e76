"""A request carried out, as the command line does it."""

from __future__ import annotations

from collections.abc import Callable

from expdesign.interruptions import interruptions_wait
from expdesign.progress import Progress, silent
from expdesign.requests import Request, command_of
from expdesign.workflows.outcome import Outcome


def carry_out(
    request: Request, *, progress: Progress = silent, tell: Callable[[str], None] = lambda line: None
) -> Outcome:
    """Do what a request asks, e.g. `carry_out(requests.Nominal(card=Path("card.toml")))`.

    Args:
        request: one of those in `expdesign.requests`.
        progress: of the command.
        tell: takes lines while the command works, of a command that has such.

    Raises:
        InputError: what is asked, or a file, is wrong.
        NoAnswer: there is none.
    """
    command = command_of(request)
    with interruptions_wait():  # some solvers do not stand being interrupted while they load
        from expdesign import workflows

        work: Callable[..., Outcome] = getattr(workflows, command.workflow)
    values = {one.name: getattr(request, one.name) for one in command.asked}
    if "no_cache" in values:
        values["cache"] = not values.pop("no_cache")
    lines = {"tell": tell} if command.tells else {}
    return work(**values, progress=progress, **lines)
