"""Area files and the charts that they name."""

from expdesign.scenario.charts.area_file import load_area
from expdesign.scenario.charts.zones import Latitude, Longitude
