"""``grace camera``: what a camera sees, and what is printed for it."""

import asyncio
from argparse import ArgumentParser, Namespace
from pathlib import Path

from robot_link.camera.extra import CameraExtraMissingError, check_extra
from robot_link.camera.sighting import SourceSettings
from robot_link.camera.uri import camera_uri
from server.cli.data import settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option

_LONGEST_LOOK_S = 3600.0
_BOARD = "board"


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    doctor = actions.add_parser(
        "doctor", help="look through a camera, say what it sees, and what to try"
    )
    doctor.add_argument(
        "uri", help="the camera, such as v4l2:///dev/video0 or http://192.0.2.7/video"
    )
    doctor.add_argument("--seconds", type=float, default=5.0, help="how long to look (default: 5)")
    doctor.add_argument("--user", default="", help="who asks, if the camera wants to know")
    doctor.add_argument(
        "--password-file", type=Path, metavar="FILE", help="file with that user's password"
    )
    add_data_option(doctor)
    sheets = actions.add_parser(
        "print", help="write plates with tags, or the calibration board, as a PDF in true size"
    )
    sheets.add_argument(
        "ids",
        help="such as 0-2 (a robot's), 100-107 (of the tank), 200-215 (latency check), or board",
    )
    sheets.add_argument(
        "--size",
        type=float,
        default=100.0,
        metavar="MM",
        help="side of the black square in mm (default: 100); the plate is 1.25 times as large",
    )
    sheets.add_argument("--out", type=Path, default=Path("tags.pdf"), help="default: tags.pdf")


def run(arguments: Namespace) -> int:
    """Do the action; the doctor's exit status says whether tags are seen well."""
    try:
        check_extra()
    except CameraExtraMissingError as error:
        raise CommandError(f"{error}.") from error
    return _print(arguments) if arguments.action == "print" else _examine(arguments)


def _examine(arguments: Namespace) -> int:
    from robot_link.camera.doctor import examine_camera

    seconds = arguments.seconds
    if not 0 < seconds <= _LONGEST_LOOK_S:
        raise CommandError(f"--seconds must be above 0 and up to {_LONGEST_LOOK_S:g}.", 2)
    try:
        camera_uri(arguments.uri)
    except ValueError as error:
        raise CommandError(f"{error}.", 2) from error
    folder = settings_of(arguments).camera_dir
    settings = SourceSettings(
        "camera",
        arguments.uri,
        folder=None if folder is None else str(folder),
        user=arguments.user,
        password=_password(arguments.password_file),
    )
    return 0 if asyncio.run(examine_camera(settings, seconds, _say)) else 1


def _password(file: Path | None) -> str:
    if file is None:
        return ""
    try:
        return file.read_text().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise CommandError(f"{file} cannot be read: {error}.", 2) from error


def _print(arguments: Namespace) -> int:
    from robot_link.camera.printed.pdf import pdf_of
    from robot_link.camera.printed.sheet import board_page, ids_of, tag_pages

    try:
        if arguments.ids == _BOARD:
            pages = [board_page()]
        else:
            pages = tag_pages(ids_of(arguments.ids), arguments.size)
        arguments.out.write_bytes(pdf_of(pages))
    except ValueError as error:
        raise CommandError(f"{error}.", 2) from error
    except OSError as error:
        raise CommandError(f"{arguments.out}: {error.strerror}.") from error
    width, height = pages[0].width_mm, pages[0].height_mm
    sheets = "1 sheet" if len(pages) == 1 else f"{len(pages)} sheets"
    _say(f"{arguments.out}: {sheets} of {width:g} x {height:g} mm.")
    _say("Print at 100 %, then measure the line of 100 mm at the foot of the sheet.")
    return 0


def _say(line: str) -> None:
    print(line, flush=True)
