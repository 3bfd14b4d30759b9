"""Real settings as small integers: a decimal with three to four digits and its power of ten.

An integer is ``sign * (mantissa * 16 + place)`` with a mantissa of at most 4095, where a place of 0
to 10 stands for 10^-place and one of 11 to 15 for 10^(place - 10). So every integer is below 2^17
and exact in a float32, 1 or 0.01 take one byte of CBOR and 0.05 two, and a reader finds the very
float that the writer rounded to. The error is at most 0.13 %.
"""

import math

_EXPONENT_MIN = -10
_EXPONENT_MAX = 5
_PLACES = 16
_MANTISSA_MAX = 4095


def code_of(value: float, *, toward_zero: bool = False) -> int:
    """Round a number to what the code can say.

    Args:
        value: The number.
        toward_zero: Never let the magnitude grow, for a value at its upper limit.

    Raises:
        ValueError: If it is not finite, or its magnitude is not within 1e-10 .. 4e8 nor 0.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot travel: it is not finite")
    if value == 0.0:
        return 0
    mantissa, exponent = _rounded(abs(value), toward_zero=toward_zero)
    if not (mantissa and exponent <= _EXPONENT_MAX):
        raise ValueError(f"{value:g} cannot travel: magnitudes are from 1e-10 to 4e8, or 0")
    code = mantissa * _PLACES + (-exponent if exponent <= 0 else exponent - _EXPONENT_MIN)
    return code if value > 0.0 else -code


def value_of(code: int) -> float:
    """Return the number that a code says: the float nearest to the decimal, everywhere the same."""
    mantissa, place = divmod(abs(code), _PLACES)
    exponent = -place if place <= -_EXPONENT_MIN else place + _EXPONENT_MIN
    magnitude = float(f"{mantissa}e{exponent}")
    return magnitude if code >= 0 else -magnitude


def _rounded(magnitude: float, *, toward_zero: bool) -> tuple[int, int]:
    """Return mantissa and exponent; the mantissa is 0 for a magnitude that is too small."""
    digits, power = f"{magnitude:.16e}".split("e")
    whole, exponent = int(digits.replace(".", "")), int(power) - 16
    for kept in (4, 3):
        drop = 17 - kept
        if exponent + drop < _EXPONENT_MIN:
            drop = _EXPONENT_MIN - exponent
        mantissa = whole // 10**drop if toward_zero else (whole + 10**drop // 2) // 10**drop
        if mantissa <= _MANTISSA_MAX:
            break
    exponent += drop
    while mantissa and mantissa % 10 == 0:
        mantissa, exponent = mantissa // 10, exponent + 1
    while exponent > _EXPONENT_MAX and mantissa * 10 <= _MANTISSA_MAX:
        mantissa, exponent = mantissa * 10, exponent - 1
    while mantissa and exponent < _EXPONENT_MIN:
        mantissa, exponent = mantissa // 10, exponent + 1
    return mantissa, exponent
