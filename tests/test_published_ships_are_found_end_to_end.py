"""A published ship, from her particulars by runs that her own model sails to a vessel that predicts her trials."""

from pathlib import Path

import pytest

from end_to_end import outcome


@pytest.mark.thorough
def test_a_vessel_of_particulars_and_runs_predicts_the_trials_of_a_published_ship(tmp_path: Path) -> None:
    """Her model has another structure, so that intervals need not hold all; eleven values hang together."""
    found = outcome("kcs", tmp_path / "kcs", planned=False, diagnosed=False, methods=("ls",))
    assert found.values > 8
    assert found.inside / found.values > 0.6
    assert found.error < 0.1
