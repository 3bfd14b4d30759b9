"""``grace demo``: a station and some robots that do not exist."""

import asyncio
import os
import shutil
import socket
import sys
import tempfile
import webbrowser
from argparse import ArgumentParser, Namespace
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import datetime, timedelta
from html import escape
from pathlib import Path

from sqlalchemy.orm import Session

from db.query.fleet.robots import (
    RobotExistsError,
    RobotRecord,
    add_robot,
    change_robot,
    list_robots,
)
from db.query.station.configurations import add_configuration, newest_configuration
from db.query.station.people import add_person, find_person
from robot_link.clock import Clock
from robot_link.messages import RobotId
from robot_link.whole_file import replace_file
from server.access import register
from server.access.role import Role
from server.base.clock_file import read_clock, start_clock, stop_clock
from server.base.secret import SecretStore
from server.base.settings import LINK_FOLDER
from server.cli.data import open_store, settings_of
from server.cli.data_folder import CLOCK_FILE, LOG_FOLDER, DataFolderError, make_data_folder
from server.cli.demo.cameras import camera_link, tell_cameras
from server.cli.demo.gateway import decide_signing, free_port, prepare_gateway
from server.cli.demo.supervisor import Child, Supervisor
from server.cli.failure import CommandError
from server.cli.option import add_data_option
from server.cli.simulate_verb import add_world_options, check_cameras
from simulator.camera.laboratory import CAMERAS_MAX
from simulator.fault import CausedFault
from simulator.fleet import (
    DEMO_ROBOTS,
    FLEET,
    STATION_ACOUSTIC,
    STATION_ADDRESS,
    SUBS,
    RobotDefinition,
    fault_names_of,
    fleet_of,
    is_sub,
    robots_named,
    sub_definition,
)
from simulator.settings import PORT_SUFFIX
from webui.build import APP, ROOT, BuildError, dev_command

DEFAULT_PORT = 8000
PORTS_TRIED = 20
PERSON = "demo"
DEV_ADDRESS = ("127.0.0.1", "5173")
"""Where the operator app is served from its sources."""
SOURCES = [ROOT / name for name in ("autonomy", "db", "robot_link", "server", "webui")]
"""Of the station."""
LINK_LIFETIME = timedelta(hours=12)
"""How long the printed sign-in waits for its one use; it opens a station on loopback only."""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    add_data_option(parser)
    parser.add_argument("--speed", type=float, default=1.0, help="how many times faster than life")
    parser.add_argument("--port", type=int, help=f"port to listen on (default: {DEFAULT_PORT})")
    parser.add_argument("--seed", type=int, default=0, help="starting point of all randomness")
    parser.add_argument(
        "--robots",
        default=",".join(DEMO_ROBOTS),
        help=f"which of {', '.join((*FLEET, *SUBS))}, or several such as mini-1..9, or the first so"
        " many of a kind, such as miniglider:10,grace3:10 (default: %(default)s)",
    )
    parser.add_argument(
        "--fleet",
        type=int,
        metavar="N",
        help="so many robots, half of them in the tank and half in the lake, in place of --robots",
    )
    add_world_options(parser)
    parser.add_argument(
        "--cameras",
        action="store_true",
        help="hang three emulated cameras over the tank, which find its robots once somebody has"
        " calibrated them (needs the extra camera)",
    )
    parser.add_argument(
        "--dev",
        action="store_true",
        help="serve the operator app from its sources and start the station again as files change",
    )
    parser.add_argument("--no-browser", action="store_true", help="do not open a browser")


def run(arguments: Namespace) -> int:
    """Run station and simulator until Ctrl-C."""
    if not 0.1 <= arguments.speed <= 50.0:
        raise CommandError("--speed lies between 0.1 and 50.", status=2)
    robots = _robots(arguments)
    arguments.robots = ",".join(robots)
    for fault in map(CausedFault.of, arguments.fault):
        if refusal := fault.refusal(fault_names_of(robots)):
            raise CommandError(f"--fault: {refusal}", status=2)
    check_cameras(arguments.cameras)
    arguments.camera_port = free_port() if arguments.cameras else None
    with _listener(arguments.port) as listener, _data_folder(arguments.data) as folder:
        clock_file = folder / CLOCK_FILE
        start_clock(clock_file, arguments.speed)
        sign_in = _prepare(folder, read_clock(clock_file), robots, arguments.camera_port)
        secrets = SecretStore(settings_of(Namespace(data=folder)).secret_dir)
        prepare_gateway(folder, secrets, _url(listener))
        decide_signing(secrets, robots)
        try:
            status = asyncio.run(_supervise(arguments, folder, listener, sign_in))
        finally:
            stop_clock(clock_file)
    print(_closing_word(arguments), flush=True)
    return status


def _robots(arguments: Namespace) -> tuple[RobotId, ...]:
    """Return the robots that are asked for.

    Raises:
        CommandError: If there are none of these; the sentence says which there are.
    """
    option = "--robots" if arguments.fleet is None else "--fleet"
    try:
        if arguments.fleet is not None:
            return fleet_of(arguments.fleet)
        return robots_named(arguments.robots.split(","))
    except ValueError as error:
        raise CommandError(f"{option}: {error}", status=2) from error


def _closing_word(arguments: Namespace) -> str:
    if arguments.data is None:
        return "Everything has stopped; the data are deleted (--data DIR keeps them)."
    return f"Everything has stopped. The data are kept in {arguments.data}."


async def _supervise(
    arguments: Namespace, folder: Path, listener: socket.socket, sign_in: str
) -> int:
    url = _url(listener)
    grace = (sys.executable, "-m", "server.cli")
    data = ("--data", str(folder), "--parent-pid", str(os.getpid()))
    clock = ("--clock-file", str(folder / CLOCK_FILE))
    port = ("--port", str(listener.getsockname()[1]), "--listen-fd", str(listener.fileno()))
    lives = ("--seed", str(arguments.seed), "--robots", arguments.robots, *_trouble(arguments))
    desk = ("--demo-port", str(free_port()))
    simulator = Child("simulator", (*grace, "simulate", *data, *desk, *lives))
    station = Child(
        "station",
        (*grace, "serve", *data, *clock, *port, *desk, "--simulation"),
        pass_fds=(listener.fileno(),),
        health_url=f"{url}/api/health",
        awaits=() if arguments.far else _radios(arguments, folder),
    )

    children = (simulator, station)
    page = url
    if arguments.dev:
        page = "http://" + ":".join(DEV_ADDRESS)
        children = (simulator, replace(station, sources=SOURCES), _dev_app(url))

    def ready() -> None:
        print(f"SIMULATION at {arguments.speed:g}x. Data: {folder}", flush=True)
        print(f"Open {page}/sign-in?token={sign_in}", flush=True)
        print("Ctrl-C stops everything.", flush=True)
        if not arguments.no_browser and _has_screen():
            webbrowser.open(_opening(folder, f"{page}/sign-in?token={sign_in}").as_uri())

    return await Supervisor(children, folder / LOG_FOLDER, ready).run()


def _opening(folder: Path, address: str) -> Path:
    """Return a page that leads to an address, which the arguments of a browser would tell all."""
    file = folder / "open.html"
    page = f'<!doctype html><meta http-equiv="refresh" content="0; url={escape(address)}">'
    replace_file(file, page.encode(), mode=0o600)
    return file


def _dev_app(station_url: str) -> Child:
    """Return the app's own server, which hands what is the station's on to it."""
    try:
        vite = dev_command(*DEV_ADDRESS, station_url)
    except BuildError as error:
        raise CommandError(str(error)) from error
    return Child("operator app", vite, folder=APP)


def _url(listener: socket.socket) -> str:
    return f"http://127.0.0.1:{listener.getsockname()[1]}"


def _radios(arguments: Namespace, folder: Path) -> tuple[Path, ...]:
    """Return the ports of the radios, which the simulator makes."""
    names = robots_named(arguments.robots.split(","))
    own = [FLEET[name] for name in names if not is_sub(name)]
    return tuple({folder / LINK_FOLDER / robot.link_name for robot in own})


def _trouble(arguments: Namespace) -> tuple[str, ...]:
    """Return the simulator's options that make a robot's life harder, or cameras see it."""
    switches = {"far": arguments.far, "ctd": arguments.ctd, "own-cameras": arguments.own_cameras}
    options = [f"--{name}" for name, is_on in switches.items() if is_on]
    numbers = ("loss", "satellite_loss", "acoustic_loss", "acoustic_outliers", "fix_depth")
    for name in numbers:
        value = getattr(arguments, name)
        if value is not None:
            options += [f"--{name.replace('_', '-')}", str(value)]
    for fault in arguments.fault:
        options += ["--fault", fault]
    if arguments.current:
        options += ["--current", arguments.current]
    if arguments.camera_port is not None:
        options += ["--cameras", str(CAMERAS_MAX), "--camera-port", str(arguments.camera_port)]
    return tuple(options)


def _prepare(
    folder: Path, clock: Clock, robots: tuple[RobotId, ...], camera_port: int | None
) -> str:
    """Make the robots and the person known to the folder's database; return a one-time sign-in."""
    at = clock.now()

    def prepare(session: Session) -> str:
        known = {robot.id for robot in list_robots(session)}
        for name in robots:
            robot = (
                _sub_record(name, folder, at) if is_sub(name) else _record(FLEET[name], folder, at)
            )
            if camera_port is not None:
                robot = replace(robot, links=(*robot.links, *camera_link(name)))
            if robot.id in known:
                change_robot(session, robot.id, links=robot.links)
            elif is_sub(name):
                with suppress(RobotExistsError):  # the folder's own robot keeps its system id
                    add_robot(session, robot)
            else:
                add_robot(session, robot)
            if not is_sub(name):
                _agree_on_satellite(session, FLEET[name], at)
        if camera_port is not None:
            tell_cameras(session, robots, camera_port, at)
        if find_person(session, PERSON) is None:
            add_person(session, PERSON, Role.ADMIN, None, at)
        return register.create_sign_in_link(
            session, PERSON, LINK_LIFETIME, at=at, by="grace demo"
        ).secret

    (folder / LINK_FOLDER).mkdir(exist_ok=True)
    with open_store(settings_of(Namespace(data=folder))) as store:
        return store.change(prepare).result()


def _agree_on_satellite(session: Session, definition: RobotDefinition, at: datetime) -> None:
    """Let the station know how often a robot calls, unless somebody has told it otherwise."""
    robot, kind = definition.robot, "satellite"
    if definition.imei and newest_configuration(session, kind, robot) is None:
        value = definition.satellite.model_dump(mode="json")
        add_configuration(session, kind, robot, value, at=at, by="grace demo")


def _record(definition: RobotDefinition, folder: Path, at: datetime) -> RobotRecord:
    link = folder.resolve() / LINK_FOLDER / definition.link_name
    links = [f"xbee://{link}"]
    if definition.imei:
        links.append(f"rockblock://{definition.imei}")
    if definition.has_station_acoustics:
        line = link.with_name(f"{definition.robot}-{STATION_ACOUSTIC}")
        options = f"us={STATION_ADDRESS}&peer={definition.acoustic_address}"
        links.append(f"micromodem://{line}?{options}")
    return RobotRecord(
        id=definition.robot,
        name=definition.robot,
        model=definition.vehicle.key,
        kind="simulated",
        system_id=definition.system_id,
        links=tuple(links),
        site=definition.site,
        created_at=at,
    )


def _sub_record(name: RobotId, folder: Path, at: datetime) -> RobotRecord:
    """Return a vehicle that is not ours, at a UDP port that its simulator is told of by a file."""
    definition, port = sub_definition(name), free_port()
    (folder / LINK_FOLDER / f"{name}{PORT_SUFFIX}").write_text(str(port))
    return RobotRecord(
        id=name,
        name=name,
        model="",
        kind="simulated",
        system_id=definition.system_id,
        links=(f"udp://127.0.0.1:{port}",),
        site=definition.site,
        created_at=at,
        protocol="mavlink",
    )


@contextmanager
def _data_folder(wanted: Path | None) -> Generator[Path]:
    if wanted is not None:
        try:
            make_data_folder(wanted)
        except DataFolderError as error:
            raise CommandError(str(error)) from error
        yield wanted.resolve()
        return
    fresh = Path(tempfile.mkdtemp(prefix="grace-demo-"))
    try:
        yield fresh
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _listener(wanted: int | None) -> socket.socket:
    """Take the port for the whole demo, so that a station that starts again finds it free.

    Raises:
        CommandError: If the port that was asked for is taken, or every one that was tried.
    """
    ports = range(DEFAULT_PORT, DEFAULT_PORT + PORTS_TRIED) if wanted is None else (wanted,)
    for port in ports:
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", port))
        except OSError:
            listener.close()
            continue
        if wanted is None and port != DEFAULT_PORT:
            print(f"Port {DEFAULT_PORT} is taken; using {port}.", flush=True)
        listener.listen()
        listener.set_inheritable(True)
        return listener
    raise CommandError(f"Port {ports[0]} is taken or not allowed; choose another with --port.")


def _has_screen() -> bool:
    return sys.platform == "darwin" or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
