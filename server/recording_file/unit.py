"""Units of foreign files and what they are in the units of the catalogue, by a closed table."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from autonomy.arrays import FloatArray


class UnitError(Exception):
    """A unit that cannot be turned into the one that is wanted; blocks its column only."""


@dataclass(frozen=True, slots=True)
class _Unit:
    quantity: str
    factor: float = 1.0
    """Times a value gives the base unit of the quantity, ..."""
    offset: float = 0.0
    """... after this was added to it."""


def _table() -> dict[str, _Unit]:
    rows: tuple[tuple[_Unit, tuple[str, ...]], ...] = (
        (_Unit("length"), ("m", "meter", "meters", "metre", "metres")),
        (_Unit("length", 0.01), ("cm", "centimeter", "centimeters")),
        (_Unit("length", 0.001), ("mm",)),
        (_Unit("length", 1000.0), ("km",)),
        (_Unit("length", 0.3048), ("ft", "feet", "foot")),
        (_Unit("length", 0.0254), ("in", "inch", "inches")),
        (_Unit("pressure"), ("dbar", "decibar", "decibars")),
        (_Unit("pressure", 10.0), ("bar", "bars")),
        (_Unit("pressure", 0.01), ("mbar", "hpa", "millibar")),
        (_Unit("pressure", 1e-4), ("pa",)),
        (_Unit("pressure", 0.1), ("kpa",)),
        (_Unit("pressure", 0.689475729), ("psi",)),
        (
            _Unit("temperature"),
            ("degc", "c", "°c", "celsius", "degree_celsius", "degrees_celsius", "deg_c",
             "degree_c", "degrees c", "deg c", "degreec", "its-90, deg c"),
        ),
        (_Unit("temperature", 5.0 / 9.0, -32.0), ("degf", "f", "°f", "fahrenheit", "deg_f")),
        (_Unit("temperature", 1.0, -273.15), ("k", "kelvin", "degk")),
        (
            _Unit("angle"),
            ("deg", "degree", "degrees", "°", "degrees_north", "degrees_east", "degree_north",
             "degree_east"),
        ),
        (_Unit("angle", 57.29577951308232), ("rad", "radian", "radians")),
        (
            _Unit("concentration"),
            ("ug/l", "ug l-1", "µg/l", "μg/l", "mg m-3", "mg/m3", "mg/m^3", "microgram/l",
             "ug/liter"),
        ),
        (_Unit("concentration", 1000.0), ("mg/l", "mg l-1", "g m-3", "g/m3")),
        (_Unit("conductivity"), ("ms/cm", "ms cm-1", "ms/cm-1", "mmho/cm")),
        (_Unit("conductivity", 10.0), ("s/m", "s m-1")),
        (_Unit("conductivity", 0.001), ("us/cm", "us cm-1", "µs/cm")),
        (_Unit("ratio"), ("1", "psu", "nodim", "pss-78", "ntu", "fnu", "unitless")),
        (_Unit("share"), ("%", "percent")),
        (_Unit("moles"), ("umol/l", "umol l-1", "micromoles/l", "mmol m-3", "mmol/m3", "µmol/l")),
        (_Unit("light"), ("umol m-2 s-1", "umol/m2/s", "ue m-2 s-1", "micromol m-2 s-1")),
        (_Unit("inverse length"), ("m-1", "1/m", "m^-1")),
        (_Unit("parts"), ("1e-9", "ppb")),
        (_Unit("counts"), ("counts", "count")),
        (_Unit("level"), ("db",)),
        (_Unit("voltage"), ("v", "volt", "volts")),
        (_Unit("mass"), ("kg",)),
        (_Unit("mass", 0.001), ("g",)),
        (_Unit("time"), ("s", "sec", "seconds", "unix s", "timestamp")),
        (_Unit("time", 0.001), ("ms", "unix ms")),
    )  # fmt: skip
    return {name: unit for unit, names in rows for name in names}


_UNITS: Final[Mapping[str, _Unit]] = MappingProxyType(_table())


def is_known(unit: str) -> bool:
    """Tell whether a unit is in the table."""
    return _named(unit) in _UNITS


def converted(values: FloatArray, unit: str, wanted: str) -> FloatArray:
    """Return values of one unit in another.

    ``1e-3`` and a missing unit count as ``1`` where a ratio is wanted: practical salinity has all
    three in files.

    Raises:
        UnitError: If either is unknown, or they measure different things.
    """
    given, target = _UNITS.get(_named(unit)), _UNITS.get(_named(wanted))
    if _named(unit) == _named(wanted):
        return values
    if target is not None and target.quantity == "ratio" and _named(unit) in ("1e-3", "g/kg"):
        return values
    if given is None:
        raise UnitError(f"the unit {unit!r} is not known; {wanted} is needed")
    if target is None or given.quantity != target.quantity:
        raise UnitError(f"the unit {unit!r} cannot become {wanted}")
    scaled = (values + given.offset) * (given.factor / target.factor)
    return scaled - target.offset if target.offset else scaled


def _named(unit: str) -> str:
    name = " ".join(unit.strip().lower().split())
    return "1" if name in ("", "none") else name
