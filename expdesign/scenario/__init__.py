"""Files in, typed values out: scenario, vessel, dictionary and area files, and the charts they name.

All files are TOML (charts are GeoJSON). Paths inside a file are relative to that file. Positions in files are latitude
and longitude in degrees (WGS84) or metres in the area's frame, headings are degrees clockwise from north; what comes
out is in metres and radians. Everything wrong in a file becomes one `FileError`: the file, the dotted key (entries of
a list count from 1, as in ``actuators[2].speed_max_rps``), the value found and what would be right.
"""

from expdesign.scenario.card_file import load_card
from expdesign.scenario.charts import load_area
from expdesign.scenario.design_file import load_repeats
from expdesign.scenario.dictionaries import NAME, NAME_RULE, LoadCases, load_cases, load_dictionary
from expdesign.scenario.import_files import INSTRUMENTS, equipped_vessel, load_mapping
from expdesign.scenario.scenario_file import load_scenario
from expdesign.scenario.values import Scenario
from expdesign.scenario.variants import load_variant
from expdesign.scenario.vessels import load_vessel
