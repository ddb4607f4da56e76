"""`expdesign estimate`: what is wrong is one line and no file, what has no answer names the parameters."""

import io
import json
import re
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.estimation.methods import ESTIMATORS, METHODS
from expdesign.estimation.regression import UNKNOWN
from expdesign.signals import Commands
from measured_trials import EULER, MODEL_SHIP, MODEL_SHIP_TRUE, model_ship_commands, write_run


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short noisy trial."""
    return write_run(tmp_path_factory.mktemp("data") / "run.csv", MODEL_SHIP_TRUE, model_ship_commands(800), **EULER)


@pytest.fixture(scope="module")
def told(run: Path, made_once) -> tuple[Path, dict]:
    """Folder of the results by all methods of that trial under an odd name, and the summary that was printed."""

    def estimated(folder: Path) -> dict:
        odd, said = folder.with_name("run <b> & co.csv"), io.StringIO()
        odd.write_bytes(run.read_bytes())
        with redirect_stdout(said):
            assert main(["estimate", str(odd), "--vessel", str(MODEL_SHIP), "--out", str(folder), "--json"]) == 0
        return json.loads(said.getvalue())["summary"]

    return made_once("estimate-of-one-run", estimated)


def line_of(capsys: pytest.CaptureFixture[str]) -> str:
    """The one line that is not progress."""
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = (line for line in captured.err.splitlines() if not line.startswith("["))
    return line


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ("--method lss", "unknown method 'lss', did you mean 'ls'?"),
        ("--fixed X_uu", "unknown parameter 'X_uu'"),
        ("--velocity guessed", "--velocity is guessed, expected one of auto, measured"),
        ("--mean some", "--mean is some, expected one of complete, batch"),
        ("--start here", "--start is here, expected one of auto, nominal, ls"),
        ("--test RUN", "is given for estimation and for testing"),
        ("--fixed X_u X_abs_u_u X_vr X_mu Y_v Y_ur Y_mu N_r N_uv N_mu", "none is left to estimate"),
        ("--vessel missing.toml", "missing.toml"),
    ],
)
def test_wrong_options_give_one_line_and_no_file(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: str, named: str
) -> None:
    typed = options.replace("RUN", str(run)).split()
    assert main(["estimate", str(run), "--vessel", str(MODEL_SHIP), "--out", str(tmp_path / "out"), *typed]) == 2
    assert named in line_of(capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (lambda text: text.replace("tau_x", "tau_xx", 1), "tau_x"),
        (lambda text: text.replace("u_mps", "u_mpss", 1).replace("north_m", "norht_m", 1), "row 1"),
        (lambda text: re.sub(r"\n0\.5,", "\n0.25,", text, count=1), "time_s"),
        (lambda text: re.sub(r"(?<=\n)([^,\n]*),", lambda m: f"{2 * float(m[1])},", text), "0.125"),
        (lambda text: "", "empty"),
    ],
    ids=["inputs", "velocities", "clock", "sample time", "nothing"],
)
def test_bad_data_are_one_line_and_no_file(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], spoil: object, named: str
) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_text(spoil(run.read_text(encoding="utf-8")), encoding="utf-8")  # type: ignore[operator]
    assert main(["estimate", str(bad), "--vessel", str(MODEL_SHIP), "--out", str(tmp_path / "out")]) == 2
    line = line_of(capsys)
    assert "bad.csv" in line
    assert named in line
    assert not (tmp_path / "out").exists()


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["iv", "oe"])
def test_a_parameter_without_information_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], method: str
) -> None:
    """No side force, ever: Y_mu cannot be seen."""
    values = model_ship_commands(800).values * (1, 0, 1)
    commands = Commands(sample_time_s=0.125, names=MODEL_SHIP_TRUE.model.inputs, values=values)
    path = write_run(tmp_path / "one.csv", MODEL_SHIP_TRUE, commands, **EULER)
    out = tmp_path / "out"
    arguments = ["estimate", str(path), "--vessel", str(MODEL_SHIP), "--out", str(out), "--method", method]
    assert main(arguments) == 3
    line = line_of(capsys)
    assert "Y_mu" in line
    assert "contain no information" in line
    assert "fix Y_mu (--fixed keeps parameters at the values of the vessel file)" in line
    assert not out.exists()
    assert main([*arguments, "--fixed", "Y_mu"]) == 0


@pytest.mark.thorough
def test_the_table_holds_what_the_file_holds(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["estimate", str(run), "--vessel", str(MODEL_SHIP), "--out", str(tmp_path), "--method", "ls", "iv"]) == 0
    )
    lines = capsys.readouterr().out.splitlines()
    found = json.loads((tmp_path / "estimate.json").read_text(encoding="utf-8"))
    rows = {line.split()[0]: line for line in lines if line.strip()}
    number = r"\(?(-?[\d.]+) \N{PLUS-MINUS SIGN} ([\d.]+)\)?(?:e(-?\d+))?"
    for name in MODEL_SHIP_TRUE.model.names:
        shown = re.findall(number, rows[name])
        assert len(shown) == 2
        first = sorted(found, key=lambda method: not found[method]["in_vessel_file"])
        for (value, std, power), method in zip(shown, first, strict=True):
            item, scale = found[method]["parameters"][name], 10.0 ** int(power or 0)
            assert float(std) * scale == pytest.approx(item["std"], rel=0.06)
            assert abs(float(value) * scale - item["value"]) <= 0.06 * item["std"]
    assert f"Open {tmp_path}/estimate.html in a browser." in lines


@pytest.mark.thorough
def test_json_says_the_same_without_a_table(told: tuple[Path, dict]) -> None:
    folder, summary = told
    found = json.loads((folder / "estimate.json").read_text(encoding="utf-8"))
    assert [name for name, entry in found.items() if entry["in_vessel_file"]] == [summary["vessel_file_holds"]]
    assert summary["vessel_file_holds"] == summary["why"].split()[0]
    for method, entry in summary["methods"].items():
        assert entry["parameters"] == found[method]["parameters"]
        assert entry["fit"] == found[method]["fit"]


@pytest.mark.thorough
def test_the_same_data_give_the_same_files(told: tuple[Path, dict], tmp_path: Path) -> None:
    folder, _ = told
    odd = folder.with_name("run <b> & co.csv")
    main(["estimate", str(odd), "--vessel", str(MODEL_SHIP), "--out", str(tmp_path), "--quiet"])
    for path in folder.iterdir():
        assert path.read_bytes() == (tmp_path / path.name).read_bytes()


@pytest.mark.thorough
def test_results_go_to_runs_by_the_name_of_the_first_file(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["estimate", str(run), "--vessel", str(MODEL_SHIP), "--method", "ls", "--quiet"]) == 0
    assert sorted(path.name for path in (tmp_path / "runs" / "run").iterdir()) == [
        "estimate.html",
        "estimate.json",
        "vessel-estimated.toml",
    ]


def test_the_page_stands_alone_and_names_everything(told: tuple[Path, dict]) -> None:
    folder, _ = told
    page = (folder / "estimate.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|href)="(?!#)', page.replace("xlink:href", "href"))
    assert "<b> & co" not in page
    assert all(f">{name}<" in page for name in MODEL_SHIP_TRUE.model.names)
    assert not re.search(r"\b(nan|inf|None)\b", re.sub(r"<(svg|style).*?</\1>", "", page, flags=re.DOTALL))
    identities = re.findall(r'\sid="([^"]+)"', page)
    assert len(identities) == len(set(identities))
    assert np.isclose(page.count("<svg"), 4)


@pytest.mark.thorough
def test_the_chosen_method_comes_first_in_every_table(run: Path, tmp_path: Path) -> None:
    """A narrow window and a narrow terminal cut off the last columns."""
    words = ["estimate", str(run), "--vessel", str(MODEL_SHIP), "--method", "ls", "iv", "oe", "--out", str(tmp_path)]
    with redirect_stdout(io.StringIO()) as said:
        assert main(words) == 0
    found = json.loads((tmp_path / "estimate.json").read_text(encoding="utf-8"))
    (chosen,) = (name for name, entry in found.items() if entry["in_vessel_file"])
    assert chosen != next(iter(found))
    page = (tmp_path / "estimate.html").read_text(encoding="utf-8")
    heads = [re.findall(r"<th[^>]*>([\w-]+)", head) for head in re.findall(r"<thead>(.*?)</thead>", page, re.DOTALL)]
    heads += [re.findall(r"[\w-]+", line) for line in said.getvalue().splitlines()]
    across = [named for head in heads if {*(named := [word for word in head if word in found])} == {*found}]
    assert len(across) >= 4, "the parameters and the fit, on the page and on the terminal"
    assert all(named[0] == chosen for named in across)


def test_help_names_every_estimator_and_all_that_may_be_unknown_and_explain_every_method(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["estimate", "--help"]) == 0
    assert {*ESTIMATORS, *UNKNOWN} <= set(re.findall(r"[a-z-]+", capsys.readouterr().out))
    assert main(["explain", "methods"]) == 0
    assert {method.name for method in METHODS} <= set(re.findall(r"[a-z-]+", capsys.readouterr().out))
