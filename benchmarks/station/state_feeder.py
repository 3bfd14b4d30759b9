"""Robots that only tell where they are, by UDP, for little of a processor.

``python -m benchmarks.station.state_feeder RATE_HZ PORT [PORT ...]`` tells each port, at which a
station listens, the state of a robot of its own so often a second, evenly one after another, and
its heartbeat once a second, until terminated. Robots are numbered from 1 in the order of ports.
"""

import socket
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from subprocess import Popen

from benchmarks.station.station_process import ended
from benchmarks.station.telemetry_fleet import state
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.telemetry import state_message
from robot_link.messages import SystemId
from tests.robot_link.far_end import heartbeat

HEARTBEAT_S = 1.0


def feed(rate_hz: float, ports: Sequence[int]) -> None:
    """Tell states until the process is terminated."""
    caller = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in ports]
    codecs = [Codec(SystemId(number), ROBOT_COMPONENT) for number in range(1, len(ports) + 1)]
    heard_s = [0.0] * len(ports)
    gap_s, due_s = 1.0 / (rate_hz * len(ports)), time.monotonic()
    while True:
        for index, port in enumerate(ports):
            now_s = time.monotonic()
            time.sleep(max(0.0, due_s - now_s))
            due_s = max(due_s + gap_s, now_s - gap_s)
            codec = codecs[index]
            if now_s - heard_s[index] >= HEARTBEAT_S:
                heard_s[index] = now_s
                caller[index].sendto(heartbeat(0, codec), ("127.0.0.1", port))
            data = codec.pack(state_message(state(index + 1, now_s)))
            caller[index].sendto(data, ("127.0.0.1", port))


@contextmanager
def feeding(rate_hz: float, ports: Sequence[int]) -> Generator[None]:
    """Let a process of its own feed these ports as long as the context lasts."""
    command = [sys.executable, "-m", __name__, str(rate_hz), *map(str, ports)]
    with ended(Popen(command)):
        yield


if __name__ == "__main__":
    feed(float(sys.argv[1]), [int(port) for port in sys.argv[2:]])
