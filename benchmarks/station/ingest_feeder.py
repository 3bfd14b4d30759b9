"""A radio that only brings packets: states and samples of a fleet, as fast as told.

``python -m benchmarks.station.ingest_feeder ROBOTS MESSAGES RATE_S`` prints the port of the
station's radio; when a line comes on standard input it sends, at RATE_S messages a second or, with
0, as fast as the station takes them. Half of the messages are states, half are samples; each
travels in a packet of its own. Whatever the station transmits is confirmed at once. When the
station hangs up, the radio ends: what was on its way is lost.
"""

import asyncio
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta

from benchmarks.station.telemetry_fleet import STATION, state
from robot_link.mavlink import telemetry
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.messages import LogId, SystemId
from robot_link.sample_log import Measurement
from robot_link.transport.datagram import Address
from robot_link.transport.xbee_frame import (
    AtCommand,
    AtReply,
    AtStatus,
    Frame,
    FrameReader,
    ReceivePacket,
    TransmitRequest,
    TransmitStatus,
    encode,
    parse_content,
)

SLICE_S = 0.01
PARAMETERS = {b"NP": b"\x01\x00", b"SH": b"\x00\x13\xa2\x00", b"SL": b"\x40\x00\x00\x00"}


def packet(codec: Codec, number: int, sequence: int, at: datetime) -> bytes:
    """Return one packet of a robot as the station's radio hands it over."""
    report = state(number, float(sequence))
    if sequence % 2:
        message = telemetry.sample_message(
            LogId(1),
            sequence // 2,
            Measurement("blue_light", 0.4, report.position_ned, report.position_std_m, at),
        )
    else:
        message = telemetry.state_message(replace(report, measured_at=at))
    frame = codec.pack(message)
    return encode(ReceivePacket(Address(STATION + number), frame).content(), 1)


class Feeder:
    """The radio at the other end of one TCP connection."""

    def __init__(self, robots: int, messages: int, rate_s: float) -> None:
        self._robots, self._rate_s = robots, rate_s
        self._codecs = [Codec(SystemId(n + 1), ROBOT_COMPONENT) for n in range(robots)]
        self._begin = asyncio.Event()
        self._sequences = iter(range(messages))
        flood = 0 if rate_s else messages // 200
        self._flood = [self._packets(200) for _ in range(flood)]
        self.has_ended = asyncio.Event()
        """Set when the station hung up after the begin."""

    def begin(self) -> None:
        """Send from now on."""
        self._begin.set()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer the station's radio commands, and bring the packets."""
        feeding = asyncio.create_task(self._feed(writer))
        frames = FrameReader(1)
        try:
            while data := await reader.read(65536):
                for content in frames.feed(data):
                    answer = _answer(parse_content(content))
                    if answer is not None:
                        writer.write(encode(answer.content(), 1))
        except ConnectionError:
            pass
        finally:
            feeding.cancel()
            writer.close()
            if self._begin.is_set():
                self.has_ended.set()

    def _packets(self, count: int) -> bytes:
        """Return the next packets of every robot in turn, stamped with the present time."""
        now = datetime.now(UTC)
        made = []
        for _, whole in zip(range(count), self._sequences, strict=False):
            sequence, robot = divmod(whole, self._robots)
            at = now - timedelta(microseconds=count - len(made))
            made.append(packet(self._codecs[robot], robot + 1, sequence, at))
        return b"".join(made)

    async def _feed(self, writer: asyncio.StreamWriter) -> None:
        await self._begin.wait()
        for some in self._flood:
            writer.write(some)
            await writer.drain()
        if not self._rate_s:
            return
        due_s = asyncio.get_running_loop().time()
        while some := self._packets(round(self._rate_s * SLICE_S)):
            writer.write(some)
            due_s += SLICE_S
            await asyncio.sleep(max(0.0, due_s - asyncio.get_running_loop().time()))


def _answer(frame: Frame | None) -> Frame | None:
    match frame:
        case AtCommand(frame_id=0) | TransmitRequest(frame_id=0):
            return None
        case AtCommand():
            value = PARAMETERS.get(frame.command, b"\x28")
            return AtReply(frame.frame_id, frame.command, AtStatus.OK, value)
        case TransmitRequest():
            return TransmitStatus(frame.frame_id, 0, 0)
        case _:
            return None


async def main(robots: int, messages: int, rate_s: float) -> None:
    feeder = Feeder(robots, messages, rate_s)
    server = await asyncio.start_server(feeder.serve, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    await asyncio.to_thread(sys.stdin.readline)
    feeder.begin()
    await feeder.has_ended.wait()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])))
