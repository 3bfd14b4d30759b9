"""Whether a text is a unit in the notation of UDUNITS-2, by its grammar and a table of names.

Products, quotients and powers of names, such as ``umol m-2 s-1``, ``kg/m3`` or ``1e-9``. The table
holds what oceanographers' instruments tell; a unit that it lacks can be written by those it has.
"""

import re

_SYMBOL_PREFIXES = ("da", "Y", "Z", "E", "P", "T", "G", "M", "k", "h", "d", "c", "m", "u", "µ",
                    "n", "p", "f", "a", "z", "y")  # fmt: skip
_NAME_PREFIXES = ("giga", "mega", "kilo", "hecto", "deci", "centi", "milli", "micro", "nano",
                  "pico")  # fmt: skip
_SYMBOLS = frozenset((
    "m", "g", "s", "A", "K", "mol", "cd", "rad", "sr", "Hz", "N", "Pa", "J", "W", "C", "V",
    "F", "ohm", "Ω", "S", "Wb", "T", "H", "lm", "lx", "Bq", "Gy", "Sv", "kat", "L", "l", "bar",
    "cal", "h", "min", "atm", "d", "t", "eV", "B", "VA", "var", "dB", "Np", "rpm",
))  # fmt: skip
_NAMES = frozenset((
    "meter", "metre", "gram", "second", "ampere", "kelvin", "mole", "candela", "radian",
    "steradian", "hertz", "newton", "pascal", "joule", "watt", "coulomb", "volt", "farad",
    "siemens", "weber", "tesla", "henry", "lumen", "lux", "becquerel", "gray", "liter",
    "litre", "bar", "calorie", "hour", "minute", "day", "year", "degree", "arcminute",
    "arcsecond", "tonne", "count", "einstein", "bit", "byte", "knot", "feet", "foot", "inch",
    "mile", "pixel",
))  # fmt: skip
_WITHOUT_PREFIX = frozenset(
    ("%", "percent", "ppm", "ppb", "ppt", "1", "°", "deg", "degrees", "degC", "degF", "degK", "°C",
     "celsius", "degree_Celsius", "degrees_Celsius", "degree_C", "degrees_north", "degrees_east",
     "PSU", "psu", "psi", "atm", "NTU", "FNU", "pH", "yr", "B", "MB", "kB", "GB")
)  # fmt: skip
_FACTOR = re.compile(
    r"(?P<number>[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?(?:\^[+-]?[0-9])?)"
    r"|(?P<name>%|°?[A-Za-zµΩ_]+|°)(?:(?:\^|\*\*)?(?P<power>[+-]?[0-9]))?"
)
_OPERATOR = re.compile(r" */ *| *[.*·] *| +")
LENGTH_MAX = 40
_SYNONYMS = {
    **dict.fromkeys(("°C", "celsius", "degree_Celsius", "degrees_Celsius", "degree_C"), "degC"),
    "percent": "%",
    **dict.fromkeys(("°", "degree", "degrees"), "deg"),
    "count": "counts",
    **dict.fromkeys(("psu", "PSU"), "1"),
    **dict.fromkeys(("l", "liter", "litre"), "L"),
    "ml": "mL",
    "ppb": "1e-9",
    "ppm": "1e-6",
}
"""Other ways to write a unit."""


def fault_of_unit(text: str) -> str | None:
    """Return what is wrong with a unit, or ``None``."""
    if not 0 < len(text) <= LENGTH_MAX:
        return f'needs 1 to {LENGTH_MAX} characters; "1" for a number without a unit'
    place = 0
    while True:
        factor = _FACTOR.match(text, place)
        if factor is None:
            return f"is no unit at {text[place:]!r}; write one such as umol/L, mS/cm or m s-1"
        name = factor["name"]
        if name is not None and not _is_known(name):
            return f"has {name!r}, which is no unit of UDUNITS that the station knows"
        place = factor.end()
        if place == len(text):
            return None
        operator = _OPERATOR.match(text, place)
        if operator is None:
            return f"is no unit at {text[place:]!r}; write one such as umol/L, mS/cm or m s-1"
        place = operator.end()


def is_same_unit(one: str, other: str) -> bool:
    """Tell whether two texts say the same unit, such as ``m/s`` and ``m s-1``.

    Units of the same kind but another size, such as g and kg, are not the same.
    """
    return one == other or _powers(one) == _powers(other)


def _powers(text: str) -> dict[str, int]:
    """Return the factors of a unit, each with its power; a text that is no unit is one factor."""
    if fault_of_unit(text) is not None:
        return {text: 1}
    powers: dict[str, int] = {}
    place, sign = 0, 1
    while place < len(text):
        factor = _FACTOR.match(text, place)
        assert factor is not None  # noqa: S101 - fault_of_unit read the same text
        name = factor["name"] or factor["number"]
        name = _SYNONYMS.get(name, name).replace("µ", "u")
        if name != "1":
            powers[name] = powers.get(name, 0) + sign * int(factor["power"] or 1)
        operator = _OPERATOR.match(text, factor.end())
        sign = -1 if operator is not None and "/" in operator[0] else 1
        place = factor.end() if operator is None else operator.end()
    return {name: power for name, power in powers.items() if power}


def _is_known(name: str) -> bool:
    if name in _WITHOUT_PREFIX or name in _SYMBOLS:
        return True
    if any(name.startswith(one) and name.removeprefix(one) in _SYMBOLS for one in _SYMBOL_PREFIXES):
        return True
    stem = next((name.removeprefix(one) for one in _NAME_PREFIXES if name.startswith(one)), name)
    return bool({stem, stem.removesuffix("s"), stem.removesuffix("es")} & _NAMES)
