"""A submarine made with mavutil alone, as another team would write it; a process of its own.

``python -m tests.robot_link.mavutil_peer PORT SYSTEM``: it calls a station at PORT of this machine
as system SYSTEM. It speaks as ArduSub does, and nothing of its code is ours. It accepts every mode,
but enters it only once a line came by its standard input. What it was told is written to standard
output, one JSON object a line.
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

LATITUDE_1E7, LONGITUDE_1E7 = 470_000_000, -850_000_000
PERIOD_S = 0.1
DEPTH_M = 6.0
RISE_M = 0.4
"""In a period, once it is told to surface."""
ALT_HOLD, SURFACE, MANUAL = 2, 9, 19


class Submarine:
    """It holds its depth at first."""

    def __init__(self, port: str, system: str, place: tuple[str, ...]) -> None:
        self.port: Any = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=int(system), source_component=1
        )
        self.latitude, self.longitude = map(int, place or (LATITUDE_1E7, LONGITUDE_1E7))
        self.mode, self.wanted = ALT_HOLD, ALT_HOLD
        self.is_armed = True
        self.depth_m = DEPTH_M

    def live(self) -> None:
        """Take what came, move, and say how it is."""
        while (message := self.port.recv_match(blocking=False)) is not None:
            if message.get_type() == "COMMAND_LONG":
                self.obey(message)
        if select.select([sys.stdin], [], [], 0.0)[0] and sys.stdin.readline():
            self.mode = self.wanted
        if self.mode == SURFACE:
            self.depth_m = max(0.0, self.depth_m - RISE_M)
        self.tell()

    def obey(self, message: Any) -> None:
        """Answer a command; what it does not know is unsupported."""
        result = mavlink.MAV_RESULT_ACCEPTED
        match message.command:
            case mavlink.MAV_CMD_DO_SET_MODE:
                self.wanted = int(message.param2)
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM if message.param1 and self.depth_m > 1.0:
                result = mavlink.MAV_RESULT_DENIED
                self.port.mav.statustext_send(mavlink.MAV_SEVERITY_WARNING, b"Arm: too deep")
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.is_armed = bool(message.param1)
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                pass
            case _:
                result = mavlink.MAV_RESULT_UNSUPPORTED
        self.port.mav.command_ack_send(message.command, result)
        if message.command != mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            say(command=message.command, parameter=message.param1, result=result)

    def tell(self) -> None:
        """Say what a station needs to know."""
        mav, ms = self.port.mav, int(time.monotonic() * 1e3) % 2**32
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.is_armed else 0
        state = mavlink.MAV_STATE_ACTIVE if self.is_armed else mavlink.MAV_STATE_STANDBY
        mav.heartbeat_send(
            mavlink.MAV_TYPE_SUBMARINE,
            mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
            flags,
            self.mode,
            state,
        )
        up_mm = round(-1e3 * self.depth_m)
        mav.global_position_int_send(ms, self.latitude, self.longitude, up_mm, up_mm, 0, 0, 0, 9000)
        mav.attitude_send(ms, 0.02, -0.1, 1.5, 0.0, 0.0, 0.0)
        healthy = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
        mav.sys_status_send(healthy, healthy, healthy, 300, 15_200, 410, 63, 0, 0, 0, 0, 0, 0)
        mav.scaled_pressure2_send(ms, 1013.25 + 97.9 * self.depth_m, 0.0, 1140)


def say(**what: Any) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main(port: str, system: str, *place: str) -> None:
    submarine = Submarine(port, system, place)
    say(ready=True)
    while True:
        submarine.live()
        time.sleep(PERIOD_S)


if __name__ == "__main__":
    main(*sys.argv[1:])
