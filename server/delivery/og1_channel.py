"""What each channel is called in a file of OG1.0: name, unit, CF name and term of the vocabulary.

Terms are those of a vendored list of the collection (``TERMS``): a name without a row of that list
gets no ``vocabulary``, as the manual allows.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from autonomy.channel import Channel

COLLECTION: Final = "http://vocab.nerc.ac.uk/collection/OG1/current/"
TERMS_DATE: Final = "2026-11-22"
"""Of the list below."""
TERMS: Final = frozenset(
    (
        *("CDOM", "CHLA", "CNDC", "DENSITY", "DEPTH", "DOXY", "FLUOCDOM", "FLUOCHLA", "FLUOPHYC"),
        *("LAT", "LAT_GPS", "LON", "LON_GPS", "OXYSAT", "PHYC", "PHYCOCYANIN", "POTDENS0", "PRES"),
        *("PSAL", "RBBP700", "SA", "SIGMA_T", "SIGTHETA", "TCPUCHLA", "TEMP", "THETA", "TIME"),
        "TURB",
    )
)
"""Terms of OG1 that two public converters agree on."""


@dataclass(frozen=True, slots=True)
class FileVariable:
    """How a channel stands in a file."""

    name: str
    units: str
    """UDUNITS, for values that are left as they are."""
    standard_name: str | None = None
    has_term: bool = False


OF_CHANNEL: Mapping[str, FileVariable] = MappingProxyType(
    {
        "blue_light": FileVariable("BLUE_LIGHT_COUNTS", "count"),
        "chlorophyll": FileVariable(
            "CHLA",
            "mg m-3",  # a microgram a litre is a milligram a cubic metre
            "mass_concentration_of_chlorophyll_a_in_sea_water",
            has_term=True,
        ),
        "temperature": FileVariable(
            "TEMP", "degree_Celsius", "sea_water_temperature", has_term=True
        ),
        "dissolved_oxygen": FileVariable(
            "OXYGEN_MASS", "mg L-1", "mass_concentration_of_oxygen_in_sea_water"
        ),
        "par": FileVariable(
            "PAR", "umol m-2 s-1", "downwelling_photosynthetic_photon_flux_in_sea_water"
        ),
        "blue_green_algae": FileVariable("PHYCOCYANIN", "mg m-3", has_term=True),
        "conductivity": FileVariable(
            "CNDC", "mS cm-1", "sea_water_electrical_conductivity", has_term=True
        ),
        "salinity": FileVariable("PSAL", "1", "sea_water_practical_salinity", has_term=True),
        "pressure": FileVariable(
            "PRES", "dbar", "sea_water_pressure_due_to_sea_water", has_term=True
        ),
        "oxygen_saturation": FileVariable(
            "OXYSAT", "percent", "fractional_saturation_of_oxygen_in_sea_water", has_term=True
        ),
        "cdom": FileVariable("CDOM", "1e-9", has_term=True),
        "backscatter": FileVariable("RBBP700", "m-1", has_term=True),
        "turbidity": FileVariable("TURB", "1", "sea_water_turbidity", has_term=True),
        "ph": FileVariable("PH", "1", "sea_water_ph_reported_on_total_scale"),
        "nitrate": FileVariable(
            "NITRATE", "umol L-1", "mole_concentration_of_nitrate_in_sea_water"
        ),
        "absolute_salinity": FileVariable(
            "SA", "g kg-1", "sea_water_absolute_salinity", has_term=True
        ),
        "density": FileVariable("DENSITY", "kg m-3", "sea_water_density", has_term=True),
        "sound_speed": FileVariable("SOUND_SPEED", "m s-1", "speed_of_sound_in_sea_water"),
        "buoyancy_frequency_squared": FileVariable(
            "BUOYANCY_FREQUENCY_SQUARED", "s-2", "square_of_brunt_vaisala_frequency_in_sea_water"
        ),
        "sound_level": FileVariable("SOUND_LEVEL", "0.1 lg(re 1 uPa)"),
        "water_depth": FileVariable("WATER_DEPTH", "m", "sea_floor_depth_below_sea_surface"),
    }
)
"""The delivered field channels, sampled or derived; a test fails for one without a row."""


def file_variable(channel: Channel) -> FileVariable:
    """Return how a channel stands in a file; a team's own has its key as name and no term."""
    known = OF_CHANNEL.get(channel.key)
    if known is not None:
        return known
    return FileVariable(channel.key.upper(), channel.unit)


def vocabulary(term: str) -> str | None:
    """Return the address of a term, ``None`` for one that the vendored list does not have."""
    return f"{COLLECTION}{term}/" if term in TERMS else None
