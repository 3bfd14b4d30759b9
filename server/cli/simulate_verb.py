"""``grace simulate``: the simulated robots and their radios."""

import asyncio
import logging
from argparse import SUPPRESS, ArgumentParser, ArgumentTypeError, Namespace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError

from autonomy.site import TANK
from db.query.station.events import add_event
from robot_link.camera.extra import CameraExtraMissingError, check_extra
from server.base.clock_file import ClockAnchors, start_clock
from server.base.secret import SecretStore
from server.base.settings import LINK_FOLDER
from server.cli.data import open_store, settings_of
from server.cli.data_folder import CLOCK_FILE, make_data_folder
from server.cli.failure import CommandError
from server.cli.option import add_data_option
from server.watch.console import log_to_console

if TYPE_CHECKING:
    from simulator.fault_desk import FaultNews

_PART_MAX = 0.9
_DEPTH_MIN_M, _DEPTH_MAX_M = 0.01, 2.0

_log = logging.getLogger(__name__)


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    add_data_option(parser)
    parser.add_argument(
        "--speed", type=float, help="how many times faster than life (default: as it was, or 1)"
    )
    parser.add_argument("--seed", type=int, default=0, help="starting point of all randomness")
    parser.add_argument(
        "--robots",
        help="names of the robots, comma between them; mini-1..9 are nine of them, and miniglider:9"
        " are the first nine of a kind; one that was added to the station as"
        " simulated lives with the vehicle and in the water that it has there",
    )
    parser.add_argument(
        "--processes",
        type=int,
        choices=range(1, 65),
        metavar="N",
        help="in how many processes robots live (default: 8 or fewer in one, more in one a core)",
    )
    add_world_options(parser)
    parser.add_argument(
        "--bodies",
        action="store_true",
        help="simulate bodies, devices and radios alone; grace robot runs the onboard programs",
    )
    parser.add_argument(
        "--demo-port",
        type=int,
        metavar="PORT",
        help="loopback port at which a station with the same option causes faults",
    )
    parser.add_argument(
        "--cameras",
        type=int,
        choices=range(4),
        default=0,
        metavar="N",
        help="how many emulated cameras hang over the tank, at most 3 (needs the extra camera)",
    )
    parser.add_argument(
        "--camera-port",
        type=int,
        metavar="PORT",
        help="loopback port of their pictures, http://127.0.0.1:PORT/camera/tank-1 and so on"
        " (default: a free one, which is printed)",
    )
    parser.add_argument("--parent-pid", type=int, help=SUPPRESS)


def add_world_options(parser: ArgumentParser) -> None:
    """Declare how far the robots and how bad the links are; demo and simulation have it alike."""
    parser.add_argument(
        "--far", action="store_true", help="begin with the lake robot out of radio range"
    )
    parser.add_argument(
        "--ctd",
        action="store_true",
        help="GRACE robots carry a CTD: salinity, conductivity and pressure",
    )
    parser.add_argument(
        "--own-cameras",
        action="store_true",
        help="robots of the tank find themselves by cameras of their own and tags on its walls",
    )
    parser.add_argument(
        "--fix-depth",
        type=depth,
        metavar="M",
        help="deeper than this, robots that cameras see take no fix, m, up to 2; the first value of"
        " their parameter FIX_DEPTH_M (default: 0.05, the surface)",
    )
    parser.add_argument(
        "--current",
        type=flow,
        metavar="FLOW",
        help="how the water flows, which robots and station are not told: gyre, double, shear, "
        "tide or uniform, such as uniform:0.02 (m/s), uniform:0.02@90 (towards the east), "
        "tide:0.08/2 (a period of 2 h), gyre:0.05+tide, or FILE.nc of an ocean model",
    )
    parser.add_argument(
        "--fault",
        type=caused,
        action="append",
        default=[],
        metavar="[ROBOT:]NAME@SECONDS",
        help="what breaks so long after a robot was switched on, by its clock: leak, pump, sensor, "
        "optode, battery, depth, gps or antenna; may be given again; without a robot it meets each",
    )
    for name, what in (
        ("loss", "radio frames that are lost"),
        ("satellite-loss", "satellite messages that are lost"),
        ("acoustic-loss", "sounds under water that are not heard"),
        ("acoustic-outliers", "acoustic ranges that are those of an echo"),
    ):
        parser.add_argument(
            f"--{name}", type=part, metavar="PART", help=f"part of the {what}, 0 to 0.9"
        )


def part(text: str) -> float:
    """Read a share that leaves something over.

    Raises:
        ArgumentTypeError: If it does not lie between 0 and 0.9.
    """
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= _PART_MAX:
        raise ArgumentTypeError(f"{text} does not lie between 0 and {_PART_MAX:g}")
    return value


def depth(text: str) -> float:
    """Read to which depth robots take fixes.

    Raises:
        ArgumentTypeError: If it does not lie between 0.01 and 2 m.
    """
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not _DEPTH_MIN_M <= value <= _DEPTH_MAX_M:
        limits = f"{_DEPTH_MIN_M:g} and {_DEPTH_MAX_M:g} m"
        raise ArgumentTypeError(f"{text} does not lie between {limits}")
    return value


def flow(text: str) -> str:
    """Check that a text names a flow.

    Raises:
        ArgumentTypeError: If it does not.
    """
    from simulator.flow import read_flow

    try:
        read_flow(text, TANK)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from error
    return text


def caused(text: str) -> str:
    """Check that a text names a fault.

    Raises:
        ArgumentTypeError: If it does not.
    """
    from simulator.fault import CausedFault

    try:
        CausedFault.of(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from error
    return text


def note_fault(folder: Path, at: datetime, news: "FaultNews") -> None:
    """Write into the event log that a fault was caused, or undone."""
    kind, level = ("fault.mended", "info") if news.is_over else ("fault.caused", "warning")
    try:
        with open_store(settings_of(Namespace(data=folder))) as store:
            store.change(
                lambda session: add_event(
                    session, at, kind, news.text, level=level, robot=news.robot
                )
            ).result()
    except CommandError as error:
        _log.warning("%s It is not in the event log: %s", news.text, error)


def check_cameras(are_wanted: bool) -> None:
    """Make sure that emulated cameras can be drawn, if they are wanted.

    Raises:
        CommandError: If a package is missing; the sentence says how to get it.
    """
    if not are_wanted:
        return
    try:
        check_extra()
    except CameraExtraMissingError as error:
        raise CommandError(f"{error}.") from error


def run(arguments: Namespace) -> int:
    """Simulate until told to stop."""
    # The simulator is heavy to import; no other verb but this one runs it.
    from server.cli.demo.gateway import MEMORY_FOLDER, NETWORK_FILE, give_keys, read_gateway
    from server.cli.robot_verb.simulated import admit_own
    from simulator.fault_desk import FaultNews
    from simulator.process import run as run_simulator
    from simulator.settings import SimulatorSettings

    check_cameras(bool(arguments.cameras))
    station = settings_of(arguments)
    folder = station.data_dir
    make_data_folder(folder)
    clock_file = folder / CLOCK_FILE
    if clock_file.exists() and arguments.speed is None:
        anchors = ClockAnchors.model_validate_json(clock_file.read_text())
    else:
        anchors = start_clock(clock_file, arguments.speed or 1.0)
    links = folder / LINK_FOLDER
    links.mkdir(exist_ok=True)
    robots = arguments.robots.split(",") if arguments.robots else []
    # Robots of the station's own have no satellite modem, and may live beside a demo that has one.
    is_apart = bool(robots) and len(admit_own(folder, robots)) == len(robots)
    said = {
        "link_folder": links,
        "wall_anchor": anchors.wall_anchor,
        "time_anchor": anchors.time_anchor,
        "speed": anchors.speed,
        "seed": arguments.seed,
        "parent_pid": arguments.parent_pid,
        "loss": arguments.loss,
        "satellite_loss": arguments.satellite_loss,
        "acoustic_loss": arguments.acoustic_loss,
        "acoustic_outliers": arguments.acoustic_outliers,
        "is_far": arguments.far,
        "has_ctd": arguments.ctd,
        "has_own_cameras": arguments.own_cameras,
        "has_programs": not arguments.bodies,
        "memory_folder": folder / MEMORY_FOLDER,
        "gateway": None if is_apart else read_gateway(folder),
        "satellite_memory": None if is_apart else folder / NETWORK_FILE,
        "current": arguments.current,
        "faults": arguments.fault,
        "desk_port": arguments.demo_port,
        "cameras": arguments.cameras,
        "camera_port": arguments.camera_port,
        "surface_depth_m": arguments.fix_depth,
        "robots": robots or None,
        "processes": arguments.processes,
    }
    try:
        settings = SimulatorSettings.model_validate(
            {name: value for name, value in said.items() if value is not None}
        )
    except ValidationError as error:
        first = error.errors()[0]
        where = f"{first['loc'][0]}: " if first["loc"] else ""
        raise CommandError(f"{where}{first['msg']}", status=2) from error
    give_keys(folder, SecretStore(station.secret_dir), settings.robots)
    log_to_console()
    time = settings.clock()

    async def tell(news: FaultNews) -> None:
        await asyncio.to_thread(note_fault, folder, time.now(), news)

    run_simulator(settings, tell)
    return 0
