"""What to try when a link stays silent: port errors and strange bytes in plain words."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from serial.tools import list_ports

from robot_link.mavlink.frame import MavlinkFrameReader
from robot_link.transport.uri import LinkUri
from robot_link.transport.xbee_frame import ApiMode, FrameReader

_OLD_MAGIC: Final = 0xFE
_OLD_OVERHEAD: Final = 8
_API_HEAD: Final = re.compile(rb"\x7e[\x00\x01].[\x88\x8b\x90]", re.DOTALL)
"""Start, length and type of what an XBee says, where its content was taken out."""
_API_HEADS_ENOUGH: Final = 3
_TEXT_SHARE: Final = 0.9
_TEXT: Final = frozenset((*range(0x20, 0x7F), 0x09, 0x0A, 0x0D))


@dataclass(frozen=True, slots=True)
class Advice:
    """One thing found, and what to do about it."""

    found: str
    """A sentence."""
    tries: tuple[str, ...] = ()
    """What to try, in this order."""


def port_advice(uri: LinkUri, reason: str) -> Advice:
    """Explain why a port could not be opened, from what the system said."""
    said = reason.lower()
    if "no such file" in said:
        return _no_line(uri.path)
    if "permission" in said:
        return Advice(
            f"This account may not use {uri.path}.",
            (
                f"Add it to the group that owns the line, {_owner_command(uri.path)},"
                " and log in anew.",
            ),
        )
    if "lock" in said or "busy" in said or "temporarily unavailable" in said:
        return Advice(
            f"Another program has {uri.path} open.",
            (
                "Stop the station, or unplug this link in it, or close the terminal program.",
                f"`fuser {uri.path}` names who has it.",
            ),
        )
    if "refused" in said or "connect call failed" in said:
        return Advice(
            f"Nobody listens at {uri.host} port {uri.port}.",
            (
                "Start the program at the far end, and see which port it names.",
                "If the far end calls and the station shall wait for it, add ?listen=1.",
            ),
        )
    if "in use" in said:
        return Advice(
            f"Another program listens at port {uri.port}.",
            (f"`ss -lntup | grep {uri.port}` names it; stop it or choose another port.",),
        )
    return Advice(f"The port does not open: {reason}.", _network_tries(uri, said))


def byte_advice(uri: LinkUri, data: bytes) -> Advice:
    """Say what bytes look like that are not what the link carries."""
    if uri.scheme != "xbee" and (mode := _api_mode(data)) is not None:
        return Advice(
            f"An XBee in API mode {mode} is at the port.",
            (f"Write the link as xbee:// instead of {uri.scheme}://, with ap={mode}.",),
        )
    if uri.scheme == "xbee" and (mode := _api_mode(data)) is not None:
        return Advice(f"The XBee is in API mode {mode}.", (f"Write ap={mode} in the link.",))
    if uri.scheme == "xbee" and MavlinkFrameReader().feed(data):
        return Advice(
            "Plain MAVLink comes from the port, not the frames of an XBee in API mode.",
            (
                "Set the radio's AP parameter to 1, if it is an XBee.",
                "For a single robot, write the link as serial:// (or tcp://) instead of xbee://.",
            ),
        )
    if _has_old_frames(data):
        return Advice(
            "The far end speaks MAVLink 1.",
            ("Set it to MAVLink 2 (on ArduPilot SERIALn_PROTOCOL 2, on PX4 MAV_PROTO_VER 2).",),
        )
    if _is_text(data):
        start = bytes(data[:40]).decode("ascii", "replace").strip()
        return Advice(
            f"Text comes from the port, beginning {start!r}.",
            ("This is a console, a GPS receiver or a modem: take the line of the radio instead.",),
        )
    wrong_speed = ("The speed may be wrong: try baud=57600, 115200, 38400 or 9600.",)
    return Advice(
        f"{len(data)} bytes came that are no MAVLink frame.",
        wrong_speed if uri.scheme in ("serial", "xbee") and uri.path else (),
    )


def envelope_advice(uri: LinkUri, data: bytes) -> Advice | None:
    """Say what stands around valid frames, where that is an XBee's; None where it is not."""
    return byte_advice(uri, data) if _api_mode(data) is not None else None


def silence_advice(uri: LinkUri) -> Advice:
    """Say what to try where the port opens and brings nothing."""
    tries = {
        "xbee": (
            "Is the robot switched on and above the water? Radio does not reach below the surface.",
            "Both radios need the same ID (network), HP (preamble) and BR (rate) parameters.",
            "Are both antennas connected and upright?",
        ),
        "serial": (
            "Is the far end switched on, and are transmit and receive lines crossed?",
            "Is the speed right? A wrong one can look like silence: try baud=115200.",
        ),
        "udp": (
            "Does the far end send to this machine's address and this port?",
            "A firewall may hold packets back.",
        ),
        "tcp": ("The far end accepts connections and says nothing: is it the right port?",),
    }
    return Advice("Nothing was heard.", tries.get(uri.scheme, ()))


def _no_line(path: str) -> Advice:
    known = sorted(port.device for port in list_ports.comports())
    seen = f"There are {', '.join(known)}." if known else "This machine has no serial line at all."
    tries: Sequence[str] = (f"Plug the radio's adapter in, then look again. {seen}",)
    if Path(path).is_symlink():
        return Advice(f"{path} leads nowhere: what it stood for is gone.", tuple(tries))
    return Advice(f"There is no line {path}.", tuple(tries))


def _owner_command(path: str) -> str:
    try:
        group = Path(path).group()
    except (OSError, KeyError):
        group = "dialout"
    return f"`sudo usermod -aG {group} {os.environ.get('USER', 'NAME')}`"


def _network_tries(uri: LinkUri, said: str) -> tuple[str, ...]:
    if "no address" in said:
        return (f"Write {uri.host} correctly, or write its number (such as 192.168.1.10).",)
    if uri.host:
        return ("Is the far end on, and in the same network? `ping` its address.",)
    return ()


def _api_mode(data: bytes) -> ApiMode | None:
    """Return the API mode whose frames these bytes hold."""
    modes: tuple[ApiMode, ApiMode] = (1, 2)
    for mode in modes:
        if FrameReader(mode).feed(data):
            return mode
    return 1 if len(_API_HEAD.findall(data)) >= _API_HEADS_ENOUGH else None


def _has_old_frames(data: bytes) -> bool:
    """Tell whether frames of MAVLink 1 follow one another in the bytes."""
    for at in [i for i, byte in enumerate(data) if byte == _OLD_MAGIC]:
        behind = at + 1
        if behind < len(data):
            behind = at + _OLD_OVERHEAD + data[behind]
            if behind < len(data) and data[behind] == _OLD_MAGIC:
                return True
    return False


def _is_text(data: bytes) -> bool:
    return bool(data) and sum(byte in _TEXT for byte in data) >= _TEXT_SHARE * len(data)
