"""What robots measure: each channel declared once, for wires, tables, screens, maps and files.

What every state report carries (depth, pitch, battery ...) is declared in its own fields
(``robot_link.messages.STATE``).
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

from autonomy.unit_text import fault_of_unit

ChannelKind = Literal["field", "housekeeping", "switch"]
"""A quantity of the water, the robot's own condition, or a condition that is on (1) or off (0)."""

Scale = Literal["linear", "log"]
"""Whether a Gaussian process sees a value or its natural logarithm."""

ColourMap = Literal["viridis", "cividis", "magma"]
"""Perceptually uniform colours of a map's mean."""

AlarmLevel = Literal["info", "watch", "warning", "severe", "critical"]
"""How much an alarm matters: diagnostic, low, medium, high, urgent, in the words of ISA-18.2."""
ALARM_LEVELS: tuple[AlarmLevel, ...] = get_args(AlarmLevel)
"""The least grave first."""

OWN_WIRE_NUMBERS = range(128, 240)
"""Numbers that a team gives to its own channels; the delivered ones are below."""
KEY_PATTERN = r"^[a-z][a-z0-9_]{0,39}$"
"""Of a channel's key."""
_STANDARD_NAME = re.compile(r"[a-z][a-z0-9_]{0,199}")
_DECIMALS_MAX = 9


@dataclass(frozen=True, slots=True)
class AlarmLimit:
    """Values beyond which a channel deserves an alarm."""

    level: AlarmLevel
    low: float | None = None
    """Below it, in the channel's unit."""
    high: float | None = None
    """Above it."""

    def is_crossed(self, value: float) -> bool:
        """Tell whether a value deserves the alarm."""
        return (self.low is not None and value < self.low) or (
            self.high is not None and value > self.high
        )


@dataclass(frozen=True, slots=True)
class Channel:
    """One scalar that a sensor measures, or that is derived from such."""

    key: str
    """Lower-case letters, digits and underscores."""
    title: str
    unit: str
    """In the notation of UDUNITS; "1" where there is none."""
    wire_number: int
    """Names it in messages and satellite records; 0 for what never travels."""
    kind: ChannelKind = "field"
    low: float = -math.inf
    """Least value that can be true."""
    high: float = math.inf
    """Greatest value that can be true."""
    scale: Scale = "linear"
    """How a Gaussian process sees it where the map's settings do not say otherwise."""
    can_map: bool = True
    """Whether a map of it makes sense."""
    standard_name: str | None = None
    """Name in the table of the Climate and Forecast conventions."""
    colour_map: ColourMap = "viridis"
    decimals: int = 2
    """Digits after the point that a screen shows."""
    alarms: tuple[AlarmLimit, ...] = ()
    """The gravest first."""
    derived_from: tuple[str, ...] = ()
    """Channels that it is computed from ashore; empty for what a sensor measures."""
    help: str = ""
    """One sentence for who does not know the quantity."""
    switch_words: tuple[str, str] = ("off", "on")
    """What a switch is called at 0 and at 1."""

    @property
    def log_floor(self) -> float:
        """A value below this is read as this on a logarithmic scale: half of the last digit."""
        return 0.5 * 10.0**-self.decimals

    @property
    def is_derived(self) -> bool:
        """Whether it is computed ashore."""
        return bool(self.derived_from)

    def words(self, value: float) -> str:
        """Return a value as a sentence has it, with its unit."""
        if self.kind == "switch":
            return self.switch_words[value >= 0.5]
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{value:.{self.decimals}f}{unit}"

    def crossed(self, value: float) -> AlarmLimit | None:
        """Return the gravest limit beyond which a value is."""
        return next((limit for limit in self.alarms if limit.is_crossed(value)), None)

    def fault(self, value: float) -> str | None:
        """Return what cannot be true about a value, or ``None``."""
        if self.low <= value <= self.high:
            return None
        return (
            f"{self.title.lower()} of {value:g} {self.unit} is outside of"
            f" {self.low:g} to {self.high:g}"
        )


def faults_of_own(channel: Channel) -> list[tuple[str, str]]:
    """Return what is wrong with a channel of a team's own: each field with its limit."""
    faults: list[tuple[str, str]] = []
    if not re.fullmatch(KEY_PATTERN.strip("^$"), channel.key):
        faults.append(("key", "must begin with a letter; 1 to 40 of a to z, 0 to 9 and _"))
    if fault := fault_of_unit(channel.unit):
        faults.append(("unit", fault))
    first, last = OWN_WIRE_NUMBERS[0], OWN_WIRE_NUMBERS[-1]
    if channel.wire_number not in OWN_WIRE_NUMBERS:
        faults.append(("wire_number", f"must be {first} to {last}; is {channel.wire_number}"))
    return faults + faults_of_shown(channel)


def faults_of_shown(channel: Channel) -> list[tuple[str, str]]:
    """Return what is wrong with what a station may change of any channel."""
    faults: list[tuple[str, str]] = []
    low, high = channel.low, channel.high
    if not low < high:
        faults.append(("low", f"must be below the high end of {high:g}; is {low:g}"))
    name = channel.standard_name
    if name is not None and not _STANDARD_NAME.fullmatch(name):
        faults.append(("standard_name", "must be lower-case letters, digits and _, as in CF"))
    if not 0 <= channel.decimals <= _DECIMALS_MAX:
        faults.append(("decimals", f"must be 0 to {_DECIMALS_MAX}; is {channel.decimals}"))
    if channel.scale == "log" and channel.kind == "field" and high <= 0.0:
        faults.append(("scale", "cannot be logarithmic of a range without positive values"))
    for limit in channel.alarms:
        ends = [end for end in (limit.low, limit.high) if end is not None]
        if not ends:
            faults.append(("alarms", f"the {limit.level} limit needs a low or a high end"))
        for end in ends:
            if not low <= end <= high:
                words = f"{limit.level} limit {end:g} must lie within {low:g} to {high:g}"
                faults.append(("alarms", f"the {words}"))
        if limit.low is not None and limit.high is not None and limit.low >= limit.high:
            faults.append(("alarms", f"the {limit.level} limit's low end must be below its high"))
    return faults


class ChannelCatalogue(Mapping[str, Channel]):
    """Channels by their keys.

    Raises:
        ValueError: If two share a key or a wire number; the sentence names both.
    """

    def __init__(self, channels: Iterable[Channel]) -> None:
        self._by_key: dict[str, Channel] = {}
        self._by_number: dict[int, Channel] = {}
        for channel in channels:
            other = self._by_key.get(channel.key) or self.numbered(channel.wire_number)
            if other is not None:
                raise ValueError(
                    f"channel {channel.key!r} (number {channel.wire_number}) and channel"
                    f" {other.key!r} (number {other.wire_number}) cannot be told apart"
                )
            self._by_key[channel.key] = channel
            if channel.wire_number:
                self._by_number[channel.wire_number] = channel

    def __getitem__(self, key: str) -> Channel:
        """Return the channel of a key."""
        return self._by_key[key]

    def __iter__(self) -> Iterator[str]:
        """Return the keys in the order of declaration."""
        return iter(self._by_key)

    def __len__(self) -> int:
        return len(self._by_key)

    def numbered(self, wire_number: int) -> Channel | None:
        """Return the channel of a number on the wire, ``None`` if it is not declared."""
        return self._by_number.get(wire_number)

    def mapped(self) -> tuple[Channel, ...]:
        """Return those of which maps make sense."""
        return tuple(channel for channel in self.values() if channel.can_map)

    def with_own(self, channels: Iterable[Channel]) -> "ChannelCatalogue":
        """Return a catalogue that has further channels.

        Raises:
            ValueError: If one has the key or the number of another.
        """
        return ChannelCatalogue((*self.values(), *channels))

    def changed(self, channels: Mapping[str, Channel]) -> "ChannelCatalogue":
        """Return a catalogue in which some channels are others of the same keys and numbers."""
        return ChannelCatalogue(channels.get(key, channel) for key, channel in self.items())


_MEASURED = (
    # What the thesis's robots carry (thesis Tables 2.2 and 2.3).
    Channel(
        "blue_light",
        "Blue light",
        "counts",
        1,
        low=0.0,
        high=65535.0,
        scale="log",
        decimals=0,
        help="What the light sensor's converter counts; no radiometric unit.",
    ),
    Channel(
        "chlorophyll",
        "Chlorophyll",
        "ug/L",
        2,
        low=-5.0,
        high=1000.0,
        standard_name="mass_concentration_of_chlorophyll_a_in_sea_water",
        help="Pigment of algae, by fluorescence.",
    ),
    Channel(
        "temperature",
        "Temperature",
        "degC",
        3,
        low=-5.0,
        high=45.0,
        standard_name="sea_water_temperature",
        colour_map="cividis",
        help="Of the water beside the robot.",
    ),
    Channel(
        "dissolved_oxygen",
        "Dissolved oxygen",
        "mg/L",
        4,
        low=0.0,
        high=50.0,
        standard_name="mass_concentration_of_oxygen_in_sea_water",
        help="By an optode; fish suffer below about 5 mg/L.",
    ),
    Channel(
        "par",
        "Photosynthetically active radiation",
        "umol m-2 s-1",
        5,
        low=-5.0,
        high=5000.0,
        scale="log",
        decimals=1,
        standard_name="downwelling_photosynthetic_photon_flux_in_sea_water",
        help="Light that plants can use, 400 to 700 nm.",
    ),
    Channel(
        "blue_green_algae",
        "Blue-green algae",
        "ug/L",
        6,
        low=-5.0,
        high=10000.0,
        help="Phycocyanin, the pigment of cyanobacteria, by fluorescence.",
    ),
    Channel(
        "conductivity",
        "Conductivity",
        "mS/cm",
        7,
        low=0.0,
        high=80.0,
        decimals=3,
        standard_name="sea_water_electrical_conductivity",
        colour_map="cividis",
    ),
    Channel(
        "salinity",
        "Practical salinity",
        "1",
        8,
        low=0.0,
        high=45.0,
        decimals=3,
        standard_name="sea_water_practical_salinity",
        colour_map="cividis",
        help="By the practical salinity scale of 1978; sea water has about 35.",
    ),
    Channel(
        "pressure",
        "Pressure",
        "dbar",
        9,
        low=-5.0,
        high=12000.0,
        can_map=False,
        standard_name="sea_water_pressure_due_to_sea_water",
        help="Of the water above the robot; one decibar a metre, nearly.",
    ),
    Channel(
        "oxygen_saturation",
        "Oxygen saturation",
        "%",
        10,
        low=0.0,
        high=300.0,
        decimals=1,
        standard_name="fractional_saturation_of_oxygen_in_sea_water",
    ),
    Channel(
        "cdom",
        "Coloured dissolved organic matter",
        "1e-9",
        11,
        low=-5.0,
        high=2000.0,
        standard_name=(
            "concentration_of_colored_dissolved_organic_matter_in_sea_water_expressed_as_equivalent"
            "_mass_fraction_of_quinine_sulfate_dihydrate"
        ),
        help="By fluorescence, in parts per billion of quinine sulphate.",
    ),
    Channel(
        "backscatter",
        "Optical backscatter",
        "m-1",
        12,
        low=-0.01,
        high=1.0,
        decimals=5,
        scale="linear",
        help="Of particles, at 700 nm.",
    ),
    Channel(
        "turbidity",
        "Turbidity (NTU)",
        "1",
        13,
        low=-5.0,
        high=4000.0,
        standard_name="sea_water_turbidity",
        help="Cloudiness of the water in nephelometric units.",
    ),
    Channel(
        "ph",
        "pH",
        "1",
        14,
        low=0.0,
        high=14.0,
        decimals=3,
        standard_name="sea_water_ph_reported_on_total_scale",
    ),
    Channel(
        "nitrate",
        "Nitrate",
        "umol/L",
        15,
        low=-5.0,
        high=2000.0,
        standard_name="mole_concentration_of_nitrate_in_sea_water",
    ),
    Channel(
        "sound_level",
        "Sound level",
        "dB",
        16,
        low=0.0,
        high=250.0,
        decimals=1,
        standard_name="sound_pressure_level_in_water",
        help="In decibels above one micropascal.",
    ),
    Channel(
        "water_depth",
        "Water depth",
        "m",
        17,
        low=0.0,
        high=11000.0,
        standard_name="sea_floor_depth_below_sea_surface",
        help="The robot's depth and the altimeter's height above the floor together.",
    ),
)

_condition = partial(Channel, kind="housekeeping", can_map=False)
"""A reading of the robot itself."""

_HOUSEKEEPING = (
    Channel(
        "leak",
        "Leak",
        "1",
        64,
        kind="switch",
        low=0.0,
        high=1.0,
        can_map=False,
        decimals=0,
        alarms=(AlarmLimit("critical", high=0.5),),
        help="Water inside of the hull.",
        switch_words=("dry", "LEAK"),
    ),
    _condition(
        "internal_pressure",
        "Internal pressure",
        "hPa",
        65,
        low=0.0,
        high=3000.0,
        decimals=0,
        alarms=(AlarmLimit("warning", high=1100.0),),
        help="Inside of the hull: a rise warns of a leak or of a battery that gives off gas.",
    ),
    _condition(
        "humidity",
        "Internal humidity",
        "%",
        66,
        low=0.0,
        high=100.0,
        decimals=0,
        alarms=(AlarmLimit("warning", high=80.0),),
    ),
    _condition(
        "internal_temperature",
        "Internal temperature",
        "degC",
        67,
        low=-40.0,
        high=150.0,
        decimals=1,
        alarms=(AlarmLimit("critical", high=75.0), AlarmLimit("warning", high=60.0)),
    ),
    _condition(
        "battery_current",
        "Battery current",
        "A",
        68,
        low=-500.0,
        high=500.0,
        help="Out of the battery is positive.",
    ),
    _condition(
        "processor_load",
        "Processor load",
        "%",
        69,
        low=0.0,
        high=100.0,
        decimals=0,
        alarms=(AlarmLimit("watch", high=95.0),),
    ),
    _condition(
        "free_disk",
        "Free disk",
        "MB",
        70,
        low=0.0,
        high=1e9,
        decimals=0,
        alarms=(AlarmLimit("warning", low=100.0),),
        help="Room that is left for the robot's own log.",
    ),
    _condition(
        "pump_current",
        "Pump current",
        "A",
        71,
        low=-100.0,
        high=100.0,
    ),
    _condition(
        "mass_current",
        "Mass current",
        "A",
        72,
        low=-100.0,
        high=100.0,
        help="Of the drive that moves the sliding mass.",
    ),
    _condition(
        "gps_satellites",
        "GPS satellites",
        "1",
        73,
        low=0.0,
        high=255.0,
        decimals=0,
    ),
    _condition(
        "gps_hdop",
        "GPS dilution of precision",
        "1",
        74,
        low=0.0,
        high=100.0,
        decimals=1,
        help="Horizontal; below 2 is good, above 5 poor.",
    ),
    _condition(
        "motor_speed",
        "Motor speed",
        "rpm",
        75,
        low=0.0,
        high=100000.0,
        decimals=0,
        help="Of the motor that turns fastest, in either direction.",
    ),
    _condition(
        "motor_current",
        "Motor current",
        "A",
        76,
        low=-500.0,
        high=500.0,
        help="Of the motor that draws most.",
    ),
    _condition(
        "motor_temperature",
        "Motor temperature",
        "degC",
        77,
        low=-40.0,
        high=300.0,
        decimals=0,
        alarms=(AlarmLimit("critical", high=110.0), AlarmLimit("warning", high=90.0)),
        help="Of the warmest motor's controller.",
    ),
    _condition(
        "depth_zero",
        "Depth sensor's zero",
        "m",
        78,
        low=-10.0,
        high=10.0,
        decimals=2,
        help="What the depth sensor reads at the surface, taken off every depth since it was"
        " zeroed.",
    ),
    _condition(
        "off_cameras",
        "Off, by cameras",
        "m",
        79,
        low=0.0,
        high=1e4,
        help="How far the robot's own estimate is from where cameras saw it at that moment; told"
        " by the station.",
    ),
)

_SALT = ("conductivity", "temperature", "pressure")
_DERIVED = (
    Channel(
        "absolute_salinity",
        "Absolute salinity",
        "g/kg",
        0,
        low=0.0,
        high=50.0,
        decimals=3,
        standard_name="sea_water_absolute_salinity",
        colour_map="cividis",
        derived_from=_SALT,
    ),
    Channel(
        "density",
        "Density",
        "kg/m3",
        0,
        low=900.0,
        high=1100.0,
        standard_name="sea_water_density",
        colour_map="cividis",
        derived_from=_SALT,
    ),
    Channel(
        "sound_speed",
        "Sound speed",
        "m/s",
        0,
        low=1300.0,
        high=1700.0,
        standard_name="speed_of_sound_in_sea_water",
        derived_from=_SALT,
    ),
    Channel(
        "buoyancy_frequency_squared",
        "Buoyancy frequency, squared",
        "s-2",
        0,
        low=-1.0,
        high=1.0,
        can_map=False,
        decimals=6,
        standard_name="square_of_brunt_vaisala_frequency_in_sea_water",
        derived_from=_SALT,
        help="How firmly the water is layered; negative where heavy water lies on light.",
    ),
)

CHANNELS = ChannelCatalogue((*_MEASURED, *_HOUSEKEEPING, *_DERIVED))
"""The delivered channels; a station adds its team's own."""


NAMED_VALUE_CHARACTERS = 10
"""Of a name in a standard MAVLink message, at most."""


def key_on_wire(wire_number: int) -> str | None:
    """Return what a number on the wire stands for, ``None`` if nobody can say.

    A number that is not delivered, such as a team's own, stays one, such as "#200", until the
    station's catalogue says its key (``key_at_station``).
    """
    channel = CHANNELS.numbered(wire_number)
    if channel is not None:
        return channel.key
    return f"#{wire_number}" if 0 < wire_number <= OWN_WIRE_NUMBERS[-1] else None


def number_on_wire(key: str) -> int:
    """Return the number that names a channel on the wire, of what ``key_on_wire`` returned.

    Raises:
        KeyError: If there is no such channel.
    """
    if key.startswith("#") and key[1:].isdecimal() and 0 < int(key[1:]) <= OWN_WIRE_NUMBERS[-1]:
        return int(key[1:])
    return CHANNELS[key].wire_number


def key_at_station(key: str, catalogue: ChannelCatalogue) -> str | None:
    """Return the key of what ``key_on_wire`` or a message named, ``None`` if nobody can say.

    A standard MAVLink name ends after ten characters: it stands for the one key that begins so.
    """
    if not (key.startswith("#") and key[1:].isdecimal()):
        if key in catalogue or len(key) < NAMED_VALUE_CHARACTERS:
            return key if key in catalogue else None
        meant = [one for one in catalogue if one.startswith(key)]
        return meant[0] if len(meant) == 1 else None
    channel = catalogue.numbered(int(key[1:]))
    return None if channel is None else channel.key
