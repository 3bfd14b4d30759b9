"""``grace simulate``: the simulated robots and their radios."""

from argparse import SUPPRESS, ArgumentParser, ArgumentTypeError, Namespace

from pydantic import ValidationError

from autonomy.site import TANK
from server.base.clock_file import ClockAnchors, start_clock
from server.base.secret import SecretStore
from server.cli.console_log import log_to_console
from server.cli.data import add_data_option, settings_of
from server.cli.data_folder import CLOCK_FILE, make_data_folder
from server.cli.failure import CommandError

LINK_FOLDER = "links"
"""Folder below the data folder where the station's ends of the radios appear."""
_PART_MAX = 0.9


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    add_data_option(parser)
    parser.add_argument(
        "--speed", type=float, help="how many times faster than life (default: as it was, or 1)"
    )
    parser.add_argument("--seed", type=int, default=0, help="starting point of all randomness")
    parser.add_argument("--robots", help="names of the robots, comma between them")
    add_world_options(parser)
    parser.add_argument(
        "--bodies",
        action="store_true",
        help="simulate bodies, devices and radios alone; grace robot runs the onboard programs",
    )
    parser.add_argument("--parent-pid", type=int, help=SUPPRESS)


def add_world_options(parser: ArgumentParser) -> None:
    """Declare how far the robots and how bad the links are; demo and simulation have it alike."""
    parser.add_argument(
        "--far", action="store_true", help="begin with the lake robot out of radio range"
    )
    parser.add_argument(
        "--current",
        type=flow,
        metavar="FLOW",
        help="how the water flows, which robots and station are not told: gyre, double, shear, "
        "tide or uniform, such as uniform:0.02 (m/s), uniform:0.02@90 (towards the east), "
        "tide:0.08/2 (a period of 2 h), gyre:0.05+tide",
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


def run(arguments: Namespace) -> int:
    """Simulate until told to stop."""
    # The simulator is heavy to import; no other verb but this one runs it.
    from server.cli.demo_gateway import MEMORY_FOLDER, NETWORK_FILE, give_keys, read_gateway
    from simulator.process import run as run_simulator
    from simulator.settings import SimulatorSettings

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
        "has_programs": not arguments.bodies,
        "memory_folder": folder / MEMORY_FOLDER,
        "gateway": read_gateway(folder),
        "satellite_memory": folder / NETWORK_FILE,
        "current": arguments.current,
        "robots": arguments.robots and arguments.robots.split(","),
    }
    try:
        settings = SimulatorSettings.model_validate(
            {name: value for name, value in said.items() if value is not None}
        )
    except ValidationError as error:
        first = error.errors()[0]
        raise CommandError(f"{first['loc'][0]}: {first['msg']}", status=2) from error
    give_keys(folder, SecretStore(station.secret_dir), settings.robots)
    log_to_console()
    run_simulator(settings)
    return 0
