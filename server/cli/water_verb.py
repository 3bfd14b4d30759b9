"""``grace water``: waters from files, the list of them, and what is told of their current."""

import secrets
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import httpx
from pydantic import ValidationError

from autonomy.site import Site
from db.fault import UnknownIdError
from db.query.fleet.waters import WaterExistsError, add_water, get_water, list_waters, robots_of
from db.query.station.events import add_event
from server.base.settings import Settings
from server.cli.data import checked, clock_of, open_remote, open_store, result_of, settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option, add_remote_options
from server.current import ocean_task
from server.current.ocean_task import PROPOSAL_FOLDER as CURRENT_PROPOSALS
from server.current.ocean_task import OceanOrder
from server.current.told import FOLDER as CURRENT_FOLDER
from server.current.told import KeptTold, read_told, told_text, write_told
from server.water import building_task, reading_task
from server.water.building_task import BuildOrder, Confirmed
from server.water.proposal import FOLDER as PROPOSAL_FOLDER
from server.water.reading_task import FORMATS, ReadingOrder
from server.water.waters import CHART_FOLDER, blank_site, free_water_id

_WORDS = {
    "name": "name",
    "kind": "kind",
    "channel": "variable",
    "datum": "depth_datum",
    "tide": "tide_offset_m",
}
"""Options, and the fields of the document that they tell."""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    add = actions.add_parser("add", help="make a water of files: outline, places, depths")
    add.add_argument(
        "file", nargs="+", type=Path, help="GeoJSON, KML, KMZ, GPX; GeoTIFF, NetCDF, XYZ text"
    )
    add.add_argument("--name", required=True, help="what operators call the water")
    add.add_argument("--id", help="short name; by default made of the name")
    add.add_argument("--kind", choices=("lake", "sea", "tank"), default="sea")
    add.add_argument("--format", choices=FORMATS, default="", help="where a name does not tell")
    add.add_argument("--crs", default="", help="of files that do not tell, such as EPSG:32617")
    add.add_argument("--depth-max", type=float, help="how deep it is, m, where no file tells")
    add.add_argument("--datum", help="what the depths count from, in words")
    add.add_argument("--tide", type=float, help="how much higher the surface stands, m")
    add.add_argument("--channel", help="key of the channel that a survey maps")
    add.add_argument("--yes", action="store_true", help="take what was read without asking")
    show = actions.add_parser("list", help="list the waters")
    current = actions.add_parser("current", help="show, tell or forget the current of a water")
    _add_current_arguments(current)
    for action in (add, show, current):
        add_data_option(action)
        add_remote_options(action)


def run(arguments: Namespace) -> int:
    """Do the action on a data folder, or through the station at ``--url``."""
    if arguments.action == "current":
        return _tell(arguments)
    if arguments.action == "list":
        for water in _listed(arguments):
            robots = ", ".join(water["robots"]) or "no robot"
            print(f"{water['id']}: {water['name']} ({robots}){water['note']}")
        return 0
    for file in arguments.file:
        if not file.is_file():
            raise CommandError(f"{file} is no file.", status=2)
    made = _add_by_station(arguments) if arguments.url else _add_to_folder(arguments)
    print(f"Added {made}.")
    return 0


def _listed(arguments: Namespace) -> Sequence[Mapping[str, Any]]:
    if arguments.url:
        with open_remote(arguments) as client:
            waters = checked(client.get("/api/waters")).json()
        return [{**one, "note": ", retired" if one["is_retired"] else ""} for one in waters]
    with open_store(settings_of(arguments)) as store, store.read() as session:
        robots = robots_of(session)
        return [
            {
                "id": water.id,
                "name": water.site.name,
                "robots": robots.get(water.id, []),
                "note": ", retired" if water.retired_at else "",
            }
            for water in list_waters(session)
        ]


def _add_to_folder(arguments: Namespace) -> str:
    """Read, confirm and add in this process; a station that runs shows the water at once."""
    settings = settings_of(arguments)
    proposals = settings.data_dir / PROPOSAL_FOLDER
    said = {field: getattr(arguments, option) for option, field in _WORDS.items()}
    words = {field: value for field, value in said.items() if value is not None}
    try:
        blank = Site.model_validate({**dict(blank_site()), **words})
    except ValidationError as error:
        raise CommandError(str(error.errors()[0]["msg"]), status=2) from error
    with open_store(settings) as store:
        found = [_read_here(file, arguments, proposals) for file in arguments.file]
        _confirm(found, arguments)
        site = Site.model_validate(_built_here(found, blank, arguments, settings))
        at = clock_of(settings).now()

        def write(session: Any) -> str:  # noqa: ANN401 - a session
            taken = {water.id for water in list_waters(session)}
            water = arguments.id or free_water_id(site.name, taken)
            add_water(session, water, site, at=at, by="command line")
            text = f"command line added the water {water} ({site.name})."
            add_event(session, at, "water.added", text, data={"water": water})
            return water

        try:
            return store.change(write).result()
        except WaterExistsError as error:
            raise CommandError(str(error)) from error


def _read_here(file: Path, arguments: Namespace, folder: Path) -> Mapping[str, Any]:
    order = ReadingOrder(
        file, file.name, arguments.format, arguments.crs, folder, secrets.token_hex(12)
    )
    return _unrefused(reading_task.run(order, lambda _: None, lambda: False), file)


def _built_here(
    found: Sequence[Mapping[str, Any]], blank: Site, arguments: Namespace, settings: Settings
) -> Mapping[str, Any]:
    order = BuildOrder(
        blank,
        True,
        arguments.depth_max,
        tuple(Confirmed(one["proposal"]) for one in found),
        settings.data_dir / PROPOSAL_FOLDER,
        settings.data_dir / CHART_FOLDER,
    )
    return _unrefused(building_task.run(order, lambda _: None, lambda: False), None)["site"]


def _add_by_station(arguments: Namespace) -> str:
    with open_remote(arguments) as client:
        found = [_read_there(file, arguments, client) for file in arguments.file]
        _confirm(found, arguments)
        said = {field: getattr(arguments, option) for option, field in _WORDS.items()}
        body = {
            **said,
            "id": arguments.id,
            "depth_max_m": arguments.depth_max,
            "proposals": [{"proposal": one["proposal"]} for one in found],
        }
        return checked(client.post("/api/waters", json=body)).json()["id"]


def _read_there(file: Path, arguments: Namespace, client: httpx.Client) -> Mapping[str, Any]:
    form = {"format": arguments.format, "crs": arguments.crs}
    with file.open("rb") as content:
        answer = client.post("/api/waters/imports", data=form, files={"file": (file.name, content)})
    return result_of(client, answer)


def _unrefused(found: Mapping[str, Any], file: Path | None) -> Mapping[str, Any]:
    if "errors" in found:
        faults = [f"{one['place']}: {one['reason']}".lstrip(": ") for one in found["errors"]]
        name = "" if file is None else f"{file}: "
        raise CommandError(name + "; ".join(faults))
    return found


def _confirm(found: Sequence[Mapping[str, Any]], arguments: Namespace) -> None:
    """Say what was read, and ask whether it is right."""
    for one in found:
        print(f"{one['file']}: {one['format']}, {one['crs']}")
        for feature in one["features"]:
            what = f"{feature['role']}, {feature['geometry']} of {feature['corners']} corners"
            print(f"  feature {feature['number']} {feature['name']!r}: {what}")
        depths = one.get("depths")
        if depths is not None:
            print(
                f"  {depths['rows']} x {depths['columns']} depths,"
                f" {depths['shallowest_m']:g} to {depths['deepest_m']:g} m,"
                f" {depths['land_share']:.0%} land, every {depths['spacing_m']:g} m"
            )
        for warning in one["warnings"]:
            print(f"  {warning}")
    _ask("Make a water of this?", is_sure=arguments.yes)


def _ask(question: str, *, is_sure: bool) -> None:
    if is_sure:
        return
    if not sys.stdin.isatty():
        raise CommandError("Nothing was kept: say --yes to take what was read.")
    if input(f"{question} [y/N] ").strip().lower() not in {"y", "yes"}:
        raise CommandError("Nothing was kept.")


def _add_current_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the action."""
    parser.add_argument("water", help="id of the water")
    parser.add_argument("file", nargs="?", type=Path, help="CF NetCDF of an ocean model")
    parser.add_argument("--north", type=float, help="of a constant current, m/s")
    parser.add_argument("--east", type=float, help="of a constant current, m/s")
    parser.add_argument("--std", type=float, help="standard deviation per axis, m/s (0.1)")
    parser.add_argument("--source", help="who or what tells it")
    parser.add_argument("--forget", action="store_true", help="forget what is told")
    parser.add_argument("--yes", action="store_true", help="take what was read without asking")


def _tell(arguments: Namespace) -> int:
    """Show, tell or forget; in a data folder a station takes it in when it starts."""
    is_typed = arguments.north is not None or arguments.east is not None
    if is_typed + (arguments.file is not None) + arguments.forget > 1:
        raise CommandError("Give a file, a constant current, or --forget.", status=2)
    if arguments.file is not None and not arguments.file.is_file():
        raise CommandError(f"{arguments.file} is no file.", status=2)
    said = {"std_m_s": arguments.std, "source": arguments.source}
    words = {name: value for name, value in said.items() if value is not None}
    if is_typed:
        level = {
            "depth_m": 0.0,
            "north_m_s": arguments.north or 0.0,
            "east_m_s": arguments.east or 0.0,
        }
        words |= {"kind": "constant", "levels": [level]}
    by_hand = _told_by_station if arguments.url else _told_in_folder
    print(by_hand(arguments, words, is_change=is_typed or arguments.file is not None))
    return 0


def _told_by_station(arguments: Namespace, words: dict[str, Any], *, is_change: bool) -> str:
    address = f"/api/waters/{arguments.water}/current"
    with open_remote(arguments) as client:
        if arguments.forget:
            checked(client.delete(address))
        elif is_change:
            if arguments.file is not None:
                with arguments.file.open("rb") as content:
                    upload = {"file": (arguments.file.name, content)}
                    answer = client.post(f"{address}/imports", files=upload)
                found = result_of(client, answer)
                _confirm_current(found, is_sure=arguments.yes)
                words["proposal"] = found["proposal"]
            checked(client.put(address, json=words))
        return checked(client.get(address)).json()["text"]


def _told_in_folder(arguments: Namespace, words: dict[str, Any], *, is_change: bool) -> str:
    settings, water = settings_of(arguments), arguments.water
    at = clock_of(settings).now()
    with open_store(settings) as store:
        try:
            with store.read() as session:
                site, told = get_water(session, water).site, read_told(session, water)
        except UnknownIdError as error:
            raise CommandError(str(error)) from error
        if arguments.file is not None:
            order = OceanOrder(
                arguments.file,
                arguments.file.name,
                water,
                site,
                settings.data_dir / CURRENT_PROPOSALS,
                settings.data_dir / CURRENT_FOLDER,
                secrets.token_hex(12),
            )
            found = ocean_task.run(order, lambda _: None, lambda: False)
            if "error" in found:
                raise CommandError(found["error"])
            _confirm_current(found, is_sure=arguments.yes)
            words = ocean_task.told_words(found) | words
        if is_change:
            try:
                told = KeptTold.model_validate(words)
            except ValidationError as error:
                raise CommandError(str(error.errors()[0]["msg"]), status=2) from error
        if is_change or arguments.forget:
            kept = None if arguments.forget else told

            def write(session: Any) -> None:  # noqa: ANN401 - a session
                write_told(session, water, kept)
                text = f"command line told the current of the water {water}."
                add_event(session, at, "water.current", text, data={"water": water})

            store.change(write).result()
            told = kept
    return "Nothing is told of the current of this water." if told is None else told_text(told, at)


def _confirm_current(found: Mapping[str, Any], *, is_sure: bool) -> None:
    """Say what was read, and ask whether it is right."""
    print(
        f"{found['file']}: {found['source'] or 'no source'}, {found['times']} times from"
        f" {found['valid_from']} to {found['valid_until']}, {found['depths']} depths from"
        f" {found['shallowest_m']:g} to {found['deepest_m']:g} m,"
        f" {found['rows']} x {found['columns']} places, up to {found['fastest_m_s']:g} m/s,"
        f" {found['unknown_share']:.0%} unknown"
    )
    for warning in found["warnings"]:
        print(f"  {warning}")
    _ask("Take this for the current of the water?", is_sure=is_sure)
