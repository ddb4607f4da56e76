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
<scheduleElement waypointId="2" eta="2027-05-31T09:00:00Z" speed="5"/></manual></schedule></schedules></route>"""
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
        ("05-31T09", "04-30T09", "goes back in time"),
        ("05-31T09:00:00Z", "05-01T09:00:00Z", "from waypoint 1 to 2, 6524 km in 3600 s: 1812 m/s, expected at"),
        ("05-31T09:00:00Z", "05-01T08:00:00Z", "km in 0 s: no time, expected at most 60 m/s"),
        ('lat="60.1" lon="-180"', 'lat="60" lon="24"', "waypoints 1 and 2 are at one place"),
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
        ("08:10:00Z", "08:00:10Z", "route 1 goes from point 1 to 2, 11.14 km in 10 s: 1114 m/s, expected at most 60"),
        ('lat="60.1"', 'lat="60"', "route 1: points 1 and 2 are at one place"),
        ("08:10:00Z", "soon", "invalid time"),
        ("</gpx>", "", "not well-formed"),
    ],
)
def test_each_rule_of_gpx_is_kept(old: str, new: str, what: str) -> None:
    assert check_gpx(GPX.encode()) == []
    assert what in " ".join(check_gpx(GPX.replace(old, new, 1).encode()))


def test_ways_of_a_schedule_are_added_where_waypoints_have_no_time() -> None:
    middle = '<rtept lat="60.05" lon="23.9"/>'
    there = GPX.replace('<rtept lat="60.1"', f'{middle}<rtept lat="60.1"')
    assert check_gpx(there.encode()) == []
    fast = there.replace("08:10:00Z", "08:02:00Z")
    assert check_gpx(fast.encode()) == [
        "route 1 goes from point 1 to 3, 15.76 km in 120 s: 131 m/s, expected at most 60 m/s"
    ]


def test_files_are_checked_by_their_ending(tmp_path: Path) -> None:
    (tmp_path / "good.rtz").write_text(GOOD)
    (tmp_path / "line.gpx").write_text(GPX)
    assert check_route_file(tmp_path / "good.rtz") == check_route_file(tmp_path / "line.gpx") == []
    with pytest.raises(FileError, match=r"expected \.rtz or \.gpx"):
        check_route_file(tmp_path / "track.csv")
    with pytest.raises(FileError, match="does not exist, expected an RTZ or GPX file"):
        check_route_file(tmp_path / "none.rtz")
