"""A mission as the bytes that travel by satellite.

A blob is CBOR of ``[format, settings, onboard, legs, check]``: the integers of the mission's
settings and onboard settings (empty before format 3, of format 4 the order to follow a target, of
format 5 how many numbers of onboard settings follow, they, and the rules of surfacing), the rows of
``leg_code``, and the first four bytes of the mission's hash. The robot rebuilds the mission and
compares, so that a mission that it would understand in another way than the station does is refused
instead of flown.
"""

import hashlib
import zlib
from dataclasses import dataclass
from enum import IntEnum
from typing import NewType, Self

import cbor2

from autonomy.planner.config import EnergyConfig
from robot_link.messages import PlanHash
from robot_link.mission import (
    ONBOARD_FORMAT,
    RULES_FORMAT,
    SETTINGS_FIELDS,
    TARGET_FORMAT,
    Mission,
)
from robot_link.onboard_settings import OnboardSettings
from robot_link.satellite.cbor_reader import CborReader
from robot_link.satellite.frame import WireError
from robot_link.satellite.leg_code import MOST_LEGS, packed_legs, unpacked_legs
from robot_link.surfacing_order import SurfacingOrder
from robot_link.target_settings import TargetSettings

TransferId = NewType("TransferId", int)
"""First four bytes of the SHA-256 of a blob; names a transfer to both ends."""

MOST_BYTES = 10_000
"""Most bytes of a blob, packed or not: what 40 messages carry."""
_CHECK_BYTES = 4
_PARTS = 5
_START = 3
"""Where the settings name the start."""
_PRICES = EnergyConfig()
"""Prices that energies are compared with where the mission brings none; part of the format."""


class BlobCodec(IntEnum):
    """How a blob is packed."""

    PLAIN = 0
    DEFLATE = 1


@dataclass(frozen=True, slots=True)
class Blob:
    """A mission, packed to travel."""

    packed: bytes
    codec: BlobCodec
    sha256: str
    """Of ``packed``, hexadecimal."""
    transfer_id: TransferId
    plan: PlanHash
    """Name of the mission, which the robot echoes."""

    @classmethod
    def of(cls, mission: Mission) -> Self:
        """Pack a mission; deflated only if that is smaller.

        Raises:
            ValueError: If the mission is longer than the wire allows.
        """
        name = mission.sha256()
        plain = _plain(mission, name)
        deflated = _deflated(plain)
        is_smaller = len(deflated) < len(plain)
        packed = deflated if is_smaller else plain
        codec = BlobCodec.DEFLATE if is_smaller else BlobCodec.PLAIN
        if max(len(plain), len(packed)) > MOST_BYTES or len(mission.legs) > MOST_LEGS:
            raise ValueError(
                f"a mission of {len(mission.legs)} legs is too long for the satellite; "
                f"at most {MOST_LEGS} legs and {MOST_BYTES} bytes travel"
            )
        digest = hashlib.sha256(packed)
        return cls(packed, codec, digest.hexdigest(), transfer_id_of(packed), name)


def transfer_id_of(packed: bytes) -> TransferId:
    """Return the name of a transfer of these bytes."""
    return TransferId(int.from_bytes(hashlib.sha256(packed).digest()[:4], "big"))


def mission_of(packed: bytes, codec: int) -> Mission:
    """Unpack a mission.

    Raises:
        WireError: If the bytes are no mission, more than a robot holds, or another mission than
            the station meant.
    """
    plain = _inflated(packed) if codec == BlobCodec.DEFLATE else packed
    if codec not in tuple(BlobCodec) or len(plain) > MOST_BYTES:
        raise WireError("the mission is packed in an unknown way, or too long")
    version, settings, onboard, rows, check = _content(plain)
    if version not in SETTINGS_FIELDS or len(settings) != SETTINGS_FIELDS[version]:
        raise WireError(f"format {version} of missions is unknown, or its settings are not its")
    if version not in (ONBOARD_FORMAT, TARGET_FORMAT, RULES_FORMAT) and onboard:
        raise WireError(f"format {version} of missions brings no onboard settings")
    try:
        onboard, rules = _with_rules(onboard) if version == RULES_FORMAT else (onboard, None)
        has_tuning = version == ONBOARD_FORMAT or (version == RULES_FORMAT and bool(onboard))
        tuning = OnboardSettings.from_integers(onboard) if has_tuning else None
        order = TargetSettings.from_integers(onboard) if version == TARGET_FORMAT else None
        start = (settings[_START], settings[_START + 1])
        legs = unpacked_legs(rows, start, _prices(tuning))
        mission = Mission.from_integers(tuple(settings), legs, tuning, order, rules)
        is_meant = _check_of(mission.sha256()) == check
    except (ValueError, ArithmeticError) as error:
        raise WireError(f"the mission is none: {error}") from error
    if not is_meant:
        raise WireError("the mission that these bytes say here is not the one that was meant")
    return mission


def _plain(mission: Mission, name: PlanHash) -> bytes:
    settings = mission.settings_integers()
    brought = mission.onboard or mission.tracking
    onboard = () if brought is None else brought.integers()
    if mission.rules is not None:
        onboard = (len(onboard), *onboard, *mission.rules.integers())
    start = (settings[_START], settings[_START + 1])
    rows = packed_legs(start, mission.leg_integers(), _prices(mission.onboard))
    return cbor2.dumps(
        [mission.format, list(settings), list(onboard), rows, _check_of(name)], canonical=True
    )


def _with_rules(numbers: list[int]) -> tuple[list[int], SurfacingOrder]:
    """Return onboard settings, empty for none, and rules of a mission of format 5.

    Raises:
        ValueError: If they are none.
    """
    count = numbers[0] if numbers else -1
    if not 0 <= count < len(numbers):
        raise ValueError("the rules of surfacing are cut short")
    return numbers[1 : 1 + count], SurfacingOrder.from_integers(numbers[1 + count :])


def _prices(onboard: OnboardSettings | None) -> EnergyConfig:
    return _PRICES if onboard is None else onboard.energy_config()


def _check_of(name: PlanHash) -> bytes:
    return bytes.fromhex(name)[:_CHECK_BYTES]


def _content(plain: bytes) -> tuple[int, list[int], list[int], list[int], bytes]:
    """Return the parts of a blob."""
    reader = CborReader(plain)
    if reader.array() != _PARTS:
        raise WireError(f"the mission is no list of {_PARTS}")
    parts = reader.integer(), reader.integers(), reader.integers(), reader.integers()
    check = reader.octets()
    reader.end()
    return (*parts, check)


def _deflated(plain: bytes) -> bytes:
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    return packer.compress(plain) + packer.flush()


def _inflated(packed: bytes) -> bytes:
    """Unpack at most a little more than a mission may have, whatever the bytes would become."""
    unpacker = zlib.decompressobj(-zlib.MAX_WBITS)
    try:
        plain = unpacker.decompress(packed, MOST_BYTES + 1)
    except zlib.error as error:
        raise WireError("the mission cannot be inflated") from error
    if len(plain) > MOST_BYTES or not unpacker.eof or unpacker.unused_data:
        raise WireError("the mission inflates to more than it may, or not to its end")
    return plain
