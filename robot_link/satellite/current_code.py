"""What a robot believes of the current, in 9 bytes; it goes with a state, whose time it has.

Big endian: i16 north, i16 east, 0.1 mm/s; u16 standard deviation, 0.1 mm/s; u8 doubt, 1/16 above
one; u8 dives; u8 fixes refused. What exceeds its field is shown as the field's end.
"""

import struct

from robot_link.current_check import checked_current
from robot_link.messages import StateReport
from robot_link.report import CurrentReport
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import OctetReader, signed, unsigned

_CURRENT = struct.Struct(">hhHBBB")
CURRENT_BYTES = _CURRENT.size
_PER_M_S = 1e4
_PER_DOUBT = 16.0


def packed_current(report: CurrentReport) -> bytes:
    """Return a report's bytes.

    Raises:
        ValueError: If a number is not finite.
    """
    north, east = (signed(speed * _PER_M_S, 2) for speed in report.current_ne_m_s)
    return _CURRENT.pack(
        north,
        east,
        unsigned(report.current_std_m_s * _PER_M_S, 2),
        unsigned((report.doubt - 1.0) * _PER_DOUBT, 1),
        unsigned(report.dives, 1),
        unsigned(report.fixes_refused, 1),
    )


def unpacked_current(reader: OctetReader, state: StateReport) -> CurrentReport:
    """Read a report.

    Args:
        reader: Where it begins.
        state: The state that it goes with, which has its time.

    Raises:
        WireError: If it is none.
    """
    north, east, std, doubt, dives, refused = _CURRENT.unpack(reader.take(CURRENT_BYTES))
    report = CurrentReport(
        robot=state.robot,
        measured_at=state.measured_at,
        received_at=state.received_at,
        current_ne_m_s=(north / _PER_M_S, east / _PER_M_S),
        current_std_m_s=std / _PER_M_S,
        doubt=1.0 + doubt / _PER_DOUBT,
        dives=dives,
        fixes_refused=refused,
    )
    try:
        return checked_current(report)
    except ValueError as error:
        raise WireError(str(error)) from error
