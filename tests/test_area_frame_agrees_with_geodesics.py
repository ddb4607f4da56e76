import math

import numpy as np
import pyproj
import pytest

from expdesign.sea_area import LocalFrame

GEOD = pyproj.Geod(ellps="WGS84")
ORIGINS = [(60.1275, 24.97), (0.0, 0.0), (-33.9, 151.2), (78.2, 15.6), (-17.0, 179.99), (58.45, -179.995)]


@pytest.mark.parametrize(("lat", "lon"), ORIGINS)
def test_metres_to_degrees_and_back_is_the_same_place(lat, lon):
    points = np.random.default_rng(1).uniform(-20_000, 20_000, (50, 2))
    frame = LocalFrame(lat, lon)
    np.testing.assert_allclose(frame.to_metres(frame.to_degrees(points)), points, atol=1e-5)
    np.testing.assert_allclose(frame.to_metres(np.array([lat, lon])), [0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(("lat", "lon"), ORIGINS)
def test_distances_agree_with_geodesics_to_the_scale_of_the_projection(lat, lon):
    """Scale of a transverse Mercator is 1 + (east / R)^2 / 2: below 2e-6 within 10 km of the centre."""
    frame = LocalFrame(lat, lon)
    points = np.random.default_rng(2).uniform(-10_000, 10_000, (30, 2, 2))
    for first, second in points:
        (lat1, lon1), (lat2, lon2) = frame.to_degrees(first), frame.to_degrees(second)
        geodesic = GEOD.line_length([lon1, lon2], [lat1, lat2])
        assert math.hypot(*(second - first)) == pytest.approx(geodesic, rel=2e-6)


@pytest.mark.parametrize(("lat", "lon"), ORIGINS)
def test_north_is_true_north_at_the_centre(lat, lon):
    frame = LocalFrame(lat, lon)
    for bearing_deg in range(0, 360, 30):
        lon2, lat2, _ = GEOD.fwd(lon, lat, bearing_deg, 2000.0)
        north, east = frame.to_metres(np.array([lat2, lon2]))
        turn = math.degrees(math.atan2(east, north)) - bearing_deg
        assert (turn + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-4)
        assert math.hypot(north, east) == pytest.approx(2000.0, abs=1e-3)
