"""The robot's records: one compact message that says all that fits.

A record, big endian, before the code of ``frame``:

    u8   version << 4 | 3
    u8   flags: bit 0 words, 1 state, 2 plan, 3 samples, 4 target, 5 current, 6 detections,
         7 channels
    u32  counter
    words    u8 acks << 4 | answers; of each ack u32 transfer id, u8 chunks, u8 state << 5 | reason
             and, while receiving, a bit for each chunk, the first in the lowest bit of the first
             byte, else the lowest byte of the counter that is answered; of each answer u24 number,
             u8 outcome
    state    ``state_code``
    plan     ``state_code``
    current  ``current_code``; only with a state
    target   ``target_code``; only with a state
    channels    ``channel_code``
    detections  ``detection_code``
    samples  ``sample_code``

One ack, state and plan take 70 bytes (of a mission of more than eight chunks that comes in, more),
which fills the first segment over the air.
"""

import struct
from datetime import datetime

from robot_link.messages import CommandNumber, RobotId, SystemId
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.blob import TransferId
from robot_link.satellite.channel_code import ChannelPart, packed_channels, unpacked_channels
from robot_link.satellite.content import (
    CommandAnswer,
    MobileOriginatedContent,
    Reason,
    ShortPlanReport,
    TransferAck,
    TransferState,
)
from robot_link.satellite.current_code import CURRENT_BYTES, packed_current, unpacked_current
from robot_link.satellite.detection_code import (
    detections_that_fit,
    packed_detections,
    unpacked_detections,
)
from robot_link.satellite.frame import (
    MAC_BYTES,
    MOBILE_ORIGINATED_MAX,
    MessageType,
    WireError,
    first_byte,
    opened_up,
    sealed_up,
)
from robot_link.satellite.octets import OctetReader
from robot_link.satellite.sample_code import most_that_fit, packed_samples, unpacked_samples
from robot_link.satellite.state_code import (
    PLAN_BYTES,
    STATE_BYTES,
    packed_plan,
    packed_state,
    reason_of,
    unpacked_plan,
    unpacked_state,
)
from robot_link.satellite.target_code import packed_target, unpacked_target

__all__ = [
    "BEST_SIZES",
    "CommandAnswer",
    "MobileOriginatedContent",
    "Reason",
    "ShortPlanReport",
    "TransferAck",
    "TransferState",
    "compose",
    "read_mobile_originated",
]

BEST_SIZES = (70, 205, 340)
"""Sizes that fill whole segments over the air."""
SMALLEST = 70
"""A record must be allowed this many bytes."""

_HEADER = struct.Struct(">BBI")
_ACK = struct.Struct(">IBB")
_WORDS, _STATE, _PLAN, _SAMPLES, _TARGET, _CURRENT, _DETECTIONS = 1, 2, 4, 8, 16, 32, 64
_CHANNELS = 128
_WORDS_MAX = 15
"""Acks, and answers, of one record."""
_REASON_BITS = 5
_NUMBER_BYTES = 3
_OUTCOMES = (
    CommandOutcome.DONE,
    CommandOutcome.NOT_NOW,
    CommandOutcome.WRONG_PLAN,
    CommandOutcome.UNSUPPORTED,
)
"""By the number that travels."""


def compose(
    content: MobileOriginatedContent, key: bytes, system: SystemId, max_bytes: int
) -> bytes:
    """Return one message of at most ``max_bytes`` that says as much of the content as fits.

    What proves a level comes first: acks, answers, state, plan, current, target, channels; heard
    tags and samples fill the rest.

    Args:
        content: What there is to say.
        key: The robot's key.
        system: The robot's MAVLink system id.
        max_bytes: Bytes that the operator allows; ``BEST_SIZES`` fill whole segments.

    Raises:
        ValueError: If ``max_bytes`` is no size of a record, a number is not finite, or a last word
            names no sending.
    """
    if not SMALLEST <= max_bytes <= MOBILE_ORIGINATED_MAX:
        raise ValueError(f"a record has {SMALLEST} to {MOBILE_ORIGINATED_MAX} bytes, max_bytes")
    room = max_bytes - _HEADER.size - MAC_BYTES
    words = _packed_words(content.acks, content.answers, room)
    parts = [(_WORDS, words)] if words else []
    room -= len(words)
    if content.state is not None and room >= STATE_BYTES:
        parts.append((_STATE, packed_state(content.state)))
        room -= STATE_BYTES
    if content.plan is not None and room >= PLAN_BYTES:
        parts.append((_PLAN, packed_plan(content.plan)))
        room -= PLAN_BYTES
    current = _packed_current(content, room)
    if current and any(flag == _STATE for flag, _ in parts):
        parts.append((_CURRENT, current))
        room -= len(current)
    target = _packed_target(content, room)
    if target and any(flag == _STATE for flag, _ in parts):
        parts.append((_TARGET, target))
        room -= len(target)
    channels = packed_channels(content.channels, room)
    if channels:
        parts.append((_CHANNELS, channels))
        room -= len(channels)
    detections = detections_that_fit(content.detections, room)
    if detections:
        parts.append((_DETECTIONS, packed_detections(detections)))
        room -= len(parts[-1][1])
    samples = most_that_fit(content.samples, room)
    if samples:
        parts.append((_SAMPLES, packed_samples(samples)))
    flags = sum(flag for flag, _ in parts)
    header = _HEADER.pack(first_byte(MessageType.RECORD), flags, content.counter)
    return sealed_up(header + b"".join(part for _, part in parts), key, system)


def sample_room(content: MobileOriginatedContent, max_bytes: int) -> int:
    """Return the bytes that ``compose`` has left for samples beside the rest of the content."""
    room = max_bytes - _HEADER.size - MAC_BYTES
    room -= len(_packed_words(content.acks, content.answers, room))
    room -= 0 if content.state is None else STATE_BYTES
    room -= 0 if content.plan is None else PLAN_BYTES
    room -= len(_packed_current(content, room))
    room -= len(_packed_target(content, room))
    room -= len(packed_channels(content.channels, room))
    if content.detections:
        room -= len(packed_detections(content.detections))
    return max(0, room)


def read_mobile_originated(
    data: bytes, key: bytes, system: SystemId, robot: RobotId, received_at: datetime
) -> MobileOriginatedContent:
    """Read a robot's record.

    Raises:
        WireError: If it is none of this robot.
    """
    kind, body = opened_up(data, key, system)
    if kind is not MessageType.RECORD or len(body) < _HEADER.size:
        raise WireError("this is no record of a robot")
    _, flags, counter = _HEADER.unpack_from(body)
    reader = OctetReader(body[_HEADER.size :])
    acks, answers = _words(reader) if flags & _WORDS else ((), ())
    state_bytes = reader.take(STATE_BYTES) if flags & _STATE else None
    plan = unpacked_plan(reader.take(PLAN_BYTES)) if flags & _PLAN else None
    state = None
    if state_bytes is not None:
        energy_used = 0.0 if plan is None else plan.energy_used
        state = unpacked_state(state_bytes, robot, received_at, energy_used)
    if flags & (_TARGET | _CURRENT) and state is None:
        raise WireError("a record tells a track or a current without a state")
    current = unpacked_current(reader, state) if flags & _CURRENT and state is not None else None
    target = unpacked_target(reader, state) if flags & _TARGET and state is not None else None
    channels = ChannelPart()
    if flags & _CHANNELS:
        said_at = received_at if state is None else state.measured_at
        channels = unpacked_channels(reader, robot, said_at, received_at)
    detections = unpacked_detections(reader, robot, received_at) if flags & _DETECTIONS else ()
    samples = unpacked_samples(reader, robot, received_at) if flags & _SAMPLES else ()
    if not reader.is_at_end:
        raise WireError("something follows the end of a record")
    return MobileOriginatedContent(
        counter, state, plan, acks, answers, samples, target, current, detections, channels
    )


def _packed_target(content: MobileOriginatedContent, room: int) -> bytes:
    """Return what is known of a target; nothing where no state says when that was."""
    if content.target is None or content.state is None:
        return b""
    return packed_target(content.target, room)


def _packed_current(content: MobileOriginatedContent, room: int) -> bytes:
    """Return what is believed of the current; nothing where no state says when, or no room is."""
    if content.current is None or content.state is None or room < CURRENT_BYTES:
        return b""
    return packed_current(content.current)


def _packed_words(
    acks: tuple[TransferAck, ...], answers: tuple[CommandAnswer, ...], room: int
) -> bytes:
    """Return acks and answers as far as they fit, the first ones first."""
    ack_parts = _fitting([_packed_ack(ack) for ack in acks], room - 1)
    room -= sum(map(len, ack_parts))
    answer_parts = _fitting([_packed_answer(answer) for answer in answers], room - 1)
    if not ack_parts and not answer_parts:
        return b""
    counts = len(ack_parts) << 4 | len(answer_parts)
    return bytes([counts]) + b"".join((*ack_parts, *answer_parts))


def _fitting(parts: list[bytes], room: int) -> list[bytes]:
    fitting: list[bytes] = []
    for part in parts[:_WORDS_MAX]:
        room -= len(part)
        if room < 0:
            break
        fitting.append(part)
    return fitting


def _packed_ack(ack: TransferAck) -> bytes:
    packed = _ACK.pack(ack.transfer_id, ack.count, ack.state << _REASON_BITS | ack.reason)
    if ack.state is not TransferState.RECEIVING:
        if ack.sending is None:
            raise ValueError("a last word on a transfer names the sending that it answers")
        return packed + bytes([ack.sending])
    bits = sum(1 << index for index in ack.received)
    return packed + bits.to_bytes(_bitmap_bytes(ack.count), "little")


def _packed_answer(answer: CommandAnswer) -> bytes:
    outcome = _OUTCOMES.index(answer.outcome)
    return answer.number.to_bytes(_NUMBER_BYTES, "big") + bytes([outcome])


def _words(
    reader: OctetReader,
) -> tuple[tuple[TransferAck, ...], tuple[CommandAnswer, ...]]:
    acks, answers = divmod(reader.take(1)[0], 1 << 4)
    return (
        tuple(_ack(reader) for _ in range(acks)),
        tuple(_answer(reader) for _ in range(answers)),
    )


def _ack(reader: OctetReader) -> TransferAck:
    transfer_id, count, word = _ACK.unpack(reader.take(_ACK.size))
    try:
        state = TransferState(word >> _REASON_BITS)
    except ValueError as error:
        raise WireError("the state of a transfer is unknown") from error
    name, reason = TransferId(transfer_id), reason_of(word)
    if state is not TransferState.RECEIVING:
        everything, sending = frozenset(range(count)), reader.take(1)[0]
        return TransferAck(name, count, everything, state, reason, sending)
    bits = int.from_bytes(reader.take(_bitmap_bytes(count)), "little")
    received = frozenset(index for index in range(count) if bits >> index & 1)
    return TransferAck(name, count, received, state, reason)


def _answer(reader: OctetReader) -> CommandAnswer:
    number = int.from_bytes(reader.take(_NUMBER_BYTES), "big")
    outcome = reader.take(1)[0]
    if outcome >= len(_OUTCOMES):
        raise WireError("the outcome of a command is unknown")
    return CommandAnswer(CommandNumber(number), _OUTCOMES[outcome])


def _bitmap_bytes(count: int) -> int:
    return (count + 7) // 8
