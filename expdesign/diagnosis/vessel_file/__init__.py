"""From a vessel file to an extended model and back."""

from expdesign.diagnosis.vessel_file.reading import extended_model, public_name, stated_values, std_keys_of
from expdesign.diagnosis.vessel_file.writing import extend
