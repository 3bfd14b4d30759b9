"""MAVSDK as a process of its own, so that the threads of its native library end with it.

``python -m tests.robot_link.mavsdk_peer ROLE URL ...``: what it saw is written to standard output,
one JSON object a line. Roles: ``ground_station URL FOLDER``; ``vehicle URL FOLDER``, which serves
parameters, files and missions; ``vessel URL SYSTEM LATITUDE LONGITUDE``, which tells of itself and
obeys modes.
"""

import asyncio
import json
import os
import sys
from collections.abc import AsyncIterator, Awaitable
from typing import Any

from mavsdk.asyncio.mavsdk import Configuration, Mavsdk
from mavsdk.asyncio.plugins.action_server.action_server import ActionServerAsync
from mavsdk.asyncio.plugins.ftp.ftp import FtpAsync
from mavsdk.asyncio.plugins.ftp_server.ftp_server import FtpServerAsync
from mavsdk.asyncio.plugins.mission_raw.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.mission_raw_server.mission_raw_server import MissionRawServerAsync
from mavsdk.asyncio.plugins.param.param import ParamAsync
from mavsdk.asyncio.plugins.param_server.param_server import ParamServerAsync
from mavsdk.asyncio.plugins.telemetry.telemetry import TelemetryAsync
from mavsdk.asyncio.plugins.telemetry_server.telemetry_server import TelemetryServerAsync
from mavsdk.component_type import ComponentType
from mavsdk.plugins.action_server.action_server import AllowableFlightModes, FlightMode
from mavsdk.plugins.mission_raw.mission_raw import MissionItem
from mavsdk.plugins.telemetry_server.telemetry_server import (
    AngularVelocityBody,
    EulerAngle,
    Heading,
    Position,
    VelocityNed,
)

LONGEST_S = 60.0
"""A machine that is busy with other things needs time."""


def say(**what: Any) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


async def first(stream: AsyncIterator[Any]) -> Any:
    """The first value of a subscription that is not made of zeros alone."""
    async for value in stream:
        if any(number for number in vars(value).values() if isinstance(number, float)):
            return value
    return None


async def within(work: Awaitable[Any]) -> Any:
    async with asyncio.timeout(LONGEST_S):
        return await work


async def ground_station(url: str, local: str) -> None:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(url)
    system = await mavsdk.first_autopilot(timeout_s=LONGEST_S)
    assert system is not None
    say(connected=True)
    telemetry = TelemetryAsync(system)
    position = await within(first(telemetry.subscribe_position()))
    attitude = await within(first(telemetry.subscribe_attitude_euler()))
    battery = await within(first(telemetry.subscribe_battery()))
    say(
        latitude_deg=position.latitude_deg,
        longitude_deg=position.longitude_deg,
        altitude_m=position.relative_altitude_m,
        pitch_deg=attitude.pitch_deg,
        voltage_v=battery.voltage_v,
    )
    mission = MissionRawAsync(system)
    items = [
        MissionItem(
            seq=number,
            frame=6,
            command=16,
            current=int(number == 0),
            autocontinue=1,
            x=round((43.0 + 1e-4 * number) * 1e7),
            y=round(-84.0 * 1e7),
            z=-2.0 - 1.5 * (number % 4),
        )
        for number in range(1, 21)
    ]
    for number, item in enumerate(items):
        item.seq, item.current = number, int(number == 0)
    await within(mission.upload_mission(items))
    again = await within(mission.download_mission())
    say(uploaded=len(items), same=[vars(item) for item in again] == [vars(item) for item in items])
    items[3].command = 18
    try:
        await within(mission.upload_mission(items))
        say(refused="")
    except Exception as error:  # noqa: BLE001 - whatever it is, the test sees it
        say(refused=str(error))
    items[3].command, items[3].z = 16, 10.0
    try:
        await within(mission.upload_mission(items))
        say(above="")
    except Exception as error:  # noqa: BLE001 - as before
        say(above=str(error))
    param = ParamAsync(system)
    everything = await within(param.get_all_params())
    say(
        ints={one.name: one.value for one in everything.int_params},
        floats={one.name: one.value for one in everything.float_params},
    )
    await within(param.set_param_int("SAT_PERIOD_S", 1234))
    await within(param.set_param_float("GAIN_PITCH", 0.75))
    say(
        period=await within(param.get_param_int("SAT_PERIOD_S")),
        gain=await within(param.get_param_float("GAIN_PITCH")),
    )

    files = FtpAsync(system)
    listed = await within(files.list_directory("/"))
    for use_burst in (False, True):
        folder = f"{local}/{use_burst}"
        async with asyncio.timeout(LONGEST_S):
            async for _ in files.download("/dive.bin", folder, use_burst):
                pass
    same = await within(files.are_files_identical(f"{local}/True/dive.bin", "/dive.bin"))
    names = [[entry.name, entry.size_bytes] for entry in listed.entries]
    say(files=names, identical=same)


async def vehicle(url: str, folder: str) -> None:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT))
    component = await mavsdk.server_component()
    params = ParamServerAsync(component)
    await params.provide_param_int("COUNT", 4)
    await params.provide_param_int("OFFSET", -77)
    await params.provide_param_float("GAIN", 0.5)
    files = FtpServerAsync(component)
    await files.set_root_dir(folder)
    missions = MissionRawServerAsync(component)
    incoming = missions.subscribe_incoming_mission()
    waiting = asyncio.ensure_future(anext(incoming))
    await mavsdk.add_any_connection(url)
    say(ready=True)
    _, plan = await within(waiting)
    say(mission=[[item.command, item.x, item.y, item.z] for item in plan.mission_items])
    await asyncio.to_thread(sys.stdin.readline)
    say(
        count=await params.retrieve_param_int("COUNT"),
        gain=await params.retrieve_param_float("GAIN"),
    )


async def vessel(url: str, system: str, latitude: str, longitude: str) -> None:
    """A vehicle at a depth of 4 m whose mission leads up; the library itself changes the mode."""
    mavsdk = Mavsdk(Configuration.create_manual(int(system), 1, True))
    component = await mavsdk.server_component()
    actions, telemetry = ActionServerAsync(component), TelemetryServerAsync(component)
    await actions.set_armable(True, False)
    await actions.set_disarmable(True, False)
    await actions.set_allowable_flight_modes(AllowableFlightModes(True, True, True))
    await actions.set_flight_mode(FlightMode.ALTCTL)
    changes = actions.subscribe_flight_mode_change()
    told = asyncio.ensure_future(anext(changes))
    await mavsdk.add_any_connection(url)
    say(ready=True)
    depth_m, is_up, still = 4.0, False, AngularVelocityBody(0.0, 0.0, 0.0)
    while True:
        if told.done() and not is_up:
            is_up = True
            say(mode=int(told.result()[1]))
        depth_m = max(0.0, depth_m - (0.5 if is_up else 0.0))
        await telemetry.publish_position(
            Position(float(latitude), float(longitude), 50.0 - depth_m, -depth_m),
            VelocityNed(0.1, 0.0, 0.0),
            Heading(90.0),
        )
        await telemetry.publish_attitude(EulerAngle(0.0, -5.0, 90.0, 0), still)
        await asyncio.sleep(0.2)


ROLES = {"ground_station": ground_station, "vehicle": vehicle, "vessel": vessel}

if __name__ == "__main__":
    role, *arguments = sys.argv[1:]
    asyncio.run(ROLES[role](*arguments))
    sys.stdout.flush()
    os._exit(0)  # the library's threads are of no interest any more
