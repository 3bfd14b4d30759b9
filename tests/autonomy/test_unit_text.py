"""What is a unit in the notation of UDUNITS, and what is said of a text that is none."""

import pytest

from autonomy.channel import CHANNELS
from autonomy.unit_text import fault_of_unit


@pytest.mark.parametrize(
    "text",
    [
        *sorted({channel.unit for channel in CHANNELS.values()}),
        "nmol/L", "W m-2 nm-1", "mg.L-1", "m s-1", "s-2", "uatm", "m^2", "10 m", "degC/m",
        "microvolts",
    ],
)  # fmt: skip
def test_units_of_instruments_are_understood(text: str) -> None:
    assert fault_of_unit(text) is None


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "1 to 40 characters"),
        ("m" * 41, "1 to 40 characters"),
        ("bananas", "'bananas'"),
        ("mg / fortnight", "'fortnight'"),
        ("ug//L", "'/L'"),
        ("m s-", "'-'"),
        ("1/", "''"),
        ("<b>", "'<b>'"),
    ],
)
def test_what_is_no_unit_is_named(text: str, named: str) -> None:
    fault = fault_of_unit(text)
    assert fault is not None
    assert named in fault
