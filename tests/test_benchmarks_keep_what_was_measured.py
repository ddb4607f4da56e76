"""The measured tables of earlier releases stay when a benchmark is recorded again."""

from record import recorded

OLD = """# Measured tables

## jobs

`python jobs.py` on 2026-01-01:

| version | scenario | all |
|---|---|---|
| 0.1.0 (2026-01-01) | a | 10 |
| 0.2.0 (2026-02-01) | a | 8 |
| 0.2.0 (2026-02-01) | b | 9 |

## others

| a | b |
"""
NEW = """## jobs

`python jobs.py` on 2026-03-01:

| version | scenario | all |
|---|---|---|
| 0.2.0 (2026-03-01) | a | 7 |
"""


def test_rows_of_other_releases_and_cases_are_kept_before_the_new_ones():
    found = recorded(OLD, "jobs", NEW)
    rows = [line for line in found.splitlines() if line.startswith("| 0.")]
    assert rows == [
        "| 0.1.0 (2026-01-01) | a | 10 |",
        "| 0.2.0 (2026-02-01) | b | 9 |",
        "| 0.2.0 (2026-03-01) | a | 7 |",
    ]
    assert "on 2026-03-01" in found
    assert "on 2026-01-01" not in found
    assert recorded(found, "jobs", NEW) == found


def test_other_sections_are_replaced_or_left_as_they_are():
    replaced = recorded(OLD, "others", "## others\n\n| c | d |\n")
    assert "| c | d |" in replaced
    assert "| a | b |" not in replaced
    assert "| 0.1.0 (2026-01-01) | a | 10 |" in replaced
