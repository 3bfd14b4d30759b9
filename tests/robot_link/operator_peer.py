"""A ground station made with mavutil alone, as another team would write it; a process of its own.

``python -m tests.robot_link.operator_peer PORT SYSTEM ROBOT``: it calls a router at PORT of this
machine as system SYSTEM, and asks of the robot with system id ROBOT what a line of its standard
input says: ``ask SECONDS``, ``release`` or ``hold`` (a change, by MAV_CMD_DO_PAUSE_CONTINUE).
Nothing of its code is ours: CONTROL_STATUS, which its dialect lacks, it reads from the frame's
bytes by MAVLink's own definition. What it hears is written to standard output, one JSON object a
line.
"""

import json
import os
import select
import sys
import time
from typing import Any

os.environ["MAVLINK20"] = "1"

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

CONTROL_STATUS, CRC_EXTRA = 512, 21
REQUEST_OPERATOR_CONTROL = 32100
PERIOD_S = 0.05
BEATS = 5


class Peer:
    """It shows itself by a heartbeat four times a second."""

    def __init__(self, port: str, system: str, robot: str) -> None:
        self.port: Any = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=int(system), source_component=190
        )
        self.system, self.robot = int(system), int(robot)
        self.seen: tuple[int, int] | None = None

    def live(self, turn: int) -> None:
        while (message := self.port.recv_match(blocking=False)) is not None:
            self.hear(message)
        if select.select([sys.stdin], [], [], 0.0)[0]:
            if not (line := sys.stdin.readline()):
                sys.exit()  # whoever started it has ended
            self.obey(line.split())
        if turn % BEATS == 0:
            self.port.mav.heartbeat_send(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE
            )

    def obey(self, words: list[str]) -> None:
        match words:
            case ["ask", seconds]:
                self.command(REQUEST_OPERATOR_CONTROL, 1, 0, float(seconds), self.system)
            case ["release"]:
                self.command(REQUEST_OPERATOR_CONTROL, 0, 0, 0, self.system)
            case _:
                self.command(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0)

    def command(self, code: int, *parameters: float) -> None:
        filled = (*parameters, *[0.0] * 7)[:7]
        self.port.mav.command_long_send(self.robot, 1, code, 0, *filled)

    def hear(self, message: Any) -> None:
        kind = message.get_type()
        if kind == f"UNKNOWN_{CONTROL_STATUS}":  # its dialect knows no more of it than the bytes
            frame = bytes(message.get_msgbuf())
            if frame[5] == self.robot:
                self.status(frame)
        elif kind == "COMMAND_ACK" and (message.get_srcSystem(), message.target_system) == (
            self.robot,
            self.system,
        ):
            say(ack=message.command, result=message.result)

    def status(self, frame: bytes) -> None:
        """Read CONTROL_STATUS: flags and who is in control; zeros at the end do not travel."""
        body = 10 + frame[1]
        checksum = mavutil.x25crc(frame[1:body])
        checksum.accumulate(bytes((CRC_EXTRA,)))
        if checksum.crc != int.from_bytes(frame[body : body + 2], "little"):
            say(bad=frame.hex())
            return
        flags, in_control = (*frame[10:body], 0, 0)[:2]
        if (flags, in_control) != self.seen:
            self.seen = flags, in_control
            say(control=in_control, flags=flags)


def say(**what: Any) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main(port: str, system: str, robot: str) -> None:
    peer, turn = Peer(port, system, robot), 0
    while True:
        peer.live(turn)
        turn += 1
        time.sleep(PERIOD_S)


if __name__ == "__main__":
    main(*sys.argv[1:])
