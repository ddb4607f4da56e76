"""The checkers accept good route files and refuse bad ones, those that pass the schema included."""

from pathlib import Path

import pytest

from expdesign.errors import FileError
from expdesign.export.formats.check import check_gpx, check_route_file, check_rtz
from sample_files import SAMPLES

GOOD = """<route xmlns="http://www.cirm.org/RTZ/1/2" version="1.2"><routeInfo routeName="good"/><waypoints>
<waypoint id="1" revision="0"><position lat="60" lon="24"/></waypoint>
<waypoint id="2" revision="0"><position lat="60.1" lon="-180"/><leg geometryType="Loxodrome" portsideXTD="0.1"/>
</waypoint></waypoints><schedules><schedule id="1"><manual><scheduleElement waypointId="1" etd="2027-05-01T08:00:00Z"/>
<scheduleElement waypointId="2" eta="2027-05-01T09:00:00Z" speed="5"/></manual></schedule></schedules></route>"""
GPX = """<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="x"><rte>
<rtept lat="60" lon="24"><time>2027-05-01T08:00:00Z</time></rtept>
<rtept lat="60.1" lon="24"><time>2027-05-01T08:10:00Z</time></rtept></rte></gpx>"""


@pytest.mark.parametrize("path", sorted((SAMPLES / "rtz/samples").glob("*.rtz")), ids=lambda path: path.stem)
def test_published_samples_are_judged_as_their_author_meant_them(path: Path) -> None:
    """Samples whose names say Error are bad; the sample's own name follows the folder's, after two underscores."""
    problems = check_rtz(path.read_bytes(), path.stem.rpartition("__")[2])
    assert bool(problems) == path.stem.startswith("Errors"), problems


def test_the_two_errors_that_no_schema_sees_are_named() -> None:
    assert check_rtz(GOOD.encode(), "good") == []
    assert check_rtz(GOOD.encode(), "other") == ["routeName is 'good', expected the file's name 'other'"]
    twice = GOOD.replace('id="2"', 'id="1"').replace('waypointId="2"', 'waypointId="1"')
    assert "waypoint id 1 is given 2 times, expected once" in check_rtz(twice.encode(), "good")


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('lon="-180"', 'lon="180"', "lon = '180', expected -180 to 180, that one excluded"),
        ('lat="60"', 'lat="91"', "lat = '91', expected -90 to 90"),
        ('lat="60"', 'lat="north"', "lat = 'north'"),
        ("Loxodrome", "GreatCircle", "geometryType = 'GreatCircle', expected Loxodrome or Orthodrome"),
        ('portsideXTD="0.1"', 'portsideXTD="12"', "portsideXTD = '12'"),
        ('waypointId="2"', 'waypointId="7"', "waypoint 7, which is not in the route"),
        ("09:00:00Z", "07:00:00Z", "goes back in time"),
        ('revision="0"', "", "waypoint 1 has no revision"),
        ('revision="0"', 'revision="-1"', "revision = '-1'"),
        ("<routeInfo", "<odd/><routeInfo", "odd stands in route"),
        ('version="1.2"', 'version="2.0"', "version is '2.0', expected one of 1.0, 1.1, 1.2"),
        ("</route>", "", "is not well-formed XML"),
        ("<route ", "<!DOCTYPE route [<!ENTITY a 'b'>]><route ", "declares a document type"),
    ],
)
def test_each_rule_of_rtz_is_kept(old: str, new: str, what: str) -> None:
    assert what in " ".join(check_rtz(GOOD.replace(old, new, 1).encode(), "good"))


def test_a_schedule_out_of_order_and_a_file_too_large_are_refused() -> None:
    swapped = GOOD.replace('waypointId="1"', 'waypointId="x"').replace('waypointId="2"', 'waypointId="1"')
    swapped = swapped.replace('waypointId="x"', 'waypointId="2"')
    assert "does not follow the order" in " ".join(check_rtz(swapped.encode(), "good"))
    large = GOOD.replace("</route>", f"<!--{'x' * 400_000}--></route>")
    assert "expected less than 400000" in " ".join(check_rtz(large.encode(), "good"))


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('version="1.1"', 'version="1.0"', "expected gpx 1.1"),
        ('creator="x"', "", "no creator"),
        ('lat="60.1"', 'lat="160"', "lat = '160'"),
        ('lat="60.1"', "", "has no lat"),
        ("08:10:00Z", "07:10:00Z", "goes back in time"),
        ("08:10:00Z", "soon", "invalid time"),
        ("</gpx>", "", "not well-formed"),
    ],
)
def test_each_rule_of_gpx_is_kept(old: str, new: str, what: str) -> None:
    assert check_gpx(GPX.encode()) == []
    assert what in " ".join(check_gpx(GPX.replace(old, new, 1).encode()))


def test_files_are_checked_by_their_ending(tmp_path: Path) -> None:
    (tmp_path / "good.rtz").write_text(GOOD)
    (tmp_path / "line.gpx").write_text(GPX)
    assert check_route_file(tmp_path / "good.rtz") == check_route_file(tmp_path / "line.gpx") == []
    with pytest.raises(FileError, match=r"expected \.rtz or \.gpx"):
        check_route_file(tmp_path / "track.csv")
    with pytest.raises(FileError, match="does not exist, expected an RTZ or GPX file"):
        check_route_file(tmp_path / "none.rtz")
