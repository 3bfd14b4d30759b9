"""``grace design``: designs from plan files of other programs, and as such files.

The station lays designs out with what it knows of a robot now, so it must run.
"""

import json
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import httpx

from server.cli.data import checked, open_remote
from server.cli.failure import CommandError
from server.cli.option import add_remote_options

FORMATS: Final = {
    ".plan": "qgc_plan",
    ".waypoints": "wpl",
    ".txt": "wpl",
    ".kml": "kml",
    ".geojson": "geojson",
    ".json": "geojson",
    ".csv": "csv",
}
"""What a file is written as, by its ending."""
_OPTIONS: Final = {
    "turns_sign": "--turn-sign",
    "default_depth_m": "--depth",
    "surface_altitude_m": "--surface-altitude",
    "land_surfaces": "--land-surfaces",
    "takes_transects": "--transects",
    "is_moved": "--move-here",
    "area": "--area",
    "imports_rest": "--import-rest",
}
"""Options that answer the questions of a file, by the question's key."""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    bring = actions.add_parser("import", help="make a design of a plan file")
    bring.add_argument("robot", help="id of the robot that it is for")
    bring.add_argument(
        "file", type=Path, help="QGroundControl .plan, QGC WPL 110, KML, KMZ, GeoJSON, CSV"
    )
    bring.add_argument("--name", help="what to call the design; by default as the file")
    bring.add_argument(
        "--turn-sign", dest="turns_sign", action="store_true", help="depths have the other sign"
    )
    bring.add_argument(
        "--depth", dest="default_depth_m", type=float, help="where the file says none, m"
    )
    bring.add_argument(
        "--surface-altitude",
        dest="surface_altitude_m",
        type=float,
        help="of the water above mean sea level, m",
    )
    bring.add_argument("--land-surfaces", action="store_true", help="a landing means coming up")
    bring.add_argument(
        "--transects", dest="takes_transects", action="store_true", help="not a survey's area"
    )
    bring.add_argument(
        "--move-here", dest="is_moved", action="store_true", help="into the middle of the water"
    )
    bring.add_argument("--area", type=int, help="number of the area that a lawnmower covers")
    bring.add_argument(
        "--import-rest", dest="imports_rest", action="store_true", help="without what is refused"
    )
    bring.add_argument("--yes", action="store_true", help="take what was read without asking")
    out = actions.add_parser("export", help="write a design as a file for other programs")
    out.add_argument("design", help="its id, such as design-3")
    out.add_argument("file", type=Path, help=f"ends in {', '.join(FORMATS)}")
    out.add_argument("--version", type=int, help="a saved version; by default as it is now")
    for action in (bring, out):
        add_remote_options(action)


def run(arguments: Namespace) -> int:
    """Do the action through the station at ``--url``."""
    if not arguments.url:
        raise CommandError("Say at which station with --url; it must run.", status=2)
    with open_remote(arguments) as client:
        if arguments.action == "import":
            _import(client, arguments)
        else:
            _export(client, arguments)
    return 0


def _import(client: httpx.Client, arguments: Namespace) -> None:
    try:
        content = arguments.file.read_bytes()
    except OSError as error:
        raise CommandError(f"{arguments.file}: {error.strerror}.", status=2) from error
    given = {key: getattr(arguments, key) for key in _OPTIONS}
    choices = {key: value for key, value in given.items() if value is not None}
    found = checked(
        client.post(
            f"/api/robots/{arguments.robot}/designs/read",
            files={"file": (arguments.file.name, content)},
            data={"choices": json.dumps(choices)},
        )
    ).json()
    _tell(found)
    needed = [_option(one) for one in found["needs"] if one["is_needed"]]
    if needed:
        raise CommandError(f"Nothing was kept: first answer with {', '.join(needed)}.")
    _confirm(is_sure=arguments.yes)
    body = {"name": arguments.name or arguments.file.stem[:80], "document": found["document"]}
    made = checked(client.post(f"/api/robots/{arguments.robot}/designs", json=body)).json()
    print(f"Added {made['id']} ({made['name']}).")


def _tell(found: Mapping[str, Any]) -> None:
    """Say what was read, what is refused, and which options answer what is open."""
    content = found["document"]["content"]
    what = content["kind"].replace("_", " ")
    if content["kind"] == "waypoints":
        what = f"{len(content['waypoints'])} waypoints over {found['distance_m']:.1f} m"
    print(f"{found['format']}: {what}")
    for area in found["areas"]:
        name = f" {area['name']!r}" if area["name"] else ""
        print(f"  area {area['number']}{name}: {area['role']}, {area['area_m2']:.2f} m2")
    for mark in found["marks"]:
        print(f"  {mark['name']}: {mark['place_deg'][0]:.7f}, {mark['place_deg'][1]:.7f}")
    for note in found["notes"]:
        print(f"  {note}")
    for one in found["refused"]:
        value = f"{one['value']}: " if one["value"] else ""
        print(f"  refused: {one['place']}: {value}{one['reason']}")
    for one in found["needs"]:
        mark = "needed" if one["is_needed"] else "possible"
        print(f"  {mark}: {one['text']} ({_option(one)})")


def _option(question: Mapping[str, str]) -> str:
    """Return the option that answers a question."""
    return _OPTIONS.get(question["key"], question["key"])


def _confirm(*, is_sure: bool) -> None:
    if is_sure:
        return
    if not sys.stdin.isatty():
        raise CommandError("Nothing was kept: say --yes to make a design of what was read.")
    if input("Make a design of this? [y/N] ").strip().lower() not in {"y", "yes"}:
        raise CommandError("Nothing was kept.")


def _export(client: httpx.Client, arguments: Namespace) -> None:
    format = FORMATS.get(arguments.file.suffix.lower())
    if format is None:
        raise CommandError(f"The file must end in {', '.join(FORMATS)}.", status=2)
    query: dict[str, Any] = {"format": format}
    if arguments.version is not None:
        query["version"] = arguments.version
    path = f"/api/designs/{arguments.design}/file"
    losses = checked(client.get(f"{path}/losses", params=query)).json()
    content = checked(client.get(path, params=query)).content
    try:
        with arguments.file.open("xb") as target:
            target.write(content)
    except OSError as error:
        raise CommandError(f"{arguments.file}: {error.strerror}; nothing was written.") from error
    print(f"{arguments.design} is in {arguments.file}.")
    for loss in losses:
        where = "kept for this station alone" if loss["is_kept"] else "not in the file"
        print(f"  {where}: {loss['text']}")
