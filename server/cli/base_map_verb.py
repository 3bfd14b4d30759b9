"""``grace base-map``: charts and pictures that lie under every map."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from server.base_map.base_maps import BaseMap, BaseMapExistsError, BaseMaps, UnknownBaseMapError
from server.base_map.tile_image import TileFileError
from server.cli.data import checked, open_remote, settings_of
from server.cli.failure import CommandError
from server.cli.option import add_data_option, add_remote_options


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    add = actions.add_parser("add", help="add a PMTiles (version 3) or MBTiles file of pictures")
    add.add_argument("file", type=Path, help="it is copied; its name becomes the map's id")
    show = actions.add_parser("list", help="list the base maps, and files that are none")
    remove = actions.add_parser("remove", help="remove a base map and delete its file")
    remove.add_argument("base_map", help="its id, as list shows it")
    for action in (add, show, remove):
        add_data_option(action)
        add_remote_options(action)


def run(arguments: Namespace) -> int:
    """Work on a data folder, whether a station runs on it or not, or on the station at --url."""
    (_by_station if arguments.url else _by_folder)(arguments)
    return 0


def _by_folder(arguments: Namespace) -> None:
    maps = BaseMaps(settings_of(arguments).data_dir)
    try:
        match arguments.action:
            case "add":
                with arguments.file.open("rb") as file:
                    _print_map(_shown(maps.add(file, arguments.file.name)))
            case "remove":
                maps.remove(arguments.base_map)
            case _:
                found, refused = maps.look()
                for one in found:
                    _print_map(_shown(one))
                for file in refused:
                    print(f"{file.file}: {file.reason}")
    except TileFileError as error:
        raise CommandError(f"{arguments.file}: {error}.") from error
    except UnknownBaseMapError as error:
        raise CommandError(f"There is no base map {arguments.base_map}.") from error
    except BaseMapExistsError as error:
        raise CommandError(str(error)) from error
    except OSError as error:
        raise CommandError(f"{error.filename or arguments.file}: {error.strerror}") from error


def _by_station(arguments: Namespace) -> None:
    with open_remote(arguments) as client:
        match arguments.action:
            case "add":
                try:
                    with arguments.file.open("rb") as file:
                        answer = client.post(
                            "/api/base-maps", files={"file": (arguments.file.name, file)}
                        )
                except OSError as error:
                    raise CommandError(f"{arguments.file}: {error.strerror}") from error
                _print_map(checked(answer).json())
            case "remove":
                checked(client.delete(f"/api/base-maps/{arguments.base_map}"))
            case _:
                answer = checked(client.get("/api/base-maps")).json()
                for one in answer["base_maps"]:
                    _print_map(one)
                for file in answer["refused"]:
                    print(f"{file['file']}: {file['reason']}")


def _shown(base_map: BaseMap) -> dict[str, Any]:
    facts = base_map.facts
    return {
        "id": base_map.id,
        "title": base_map.title,
        "bytes": base_map.bytes,
        "min_zoom": facts.min_zoom,
        "max_zoom": facts.max_zoom,
        "south_deg": facts.south_deg,
        "north_deg": facts.north_deg,
        "west_deg": facts.west_deg,
        "east_deg": facts.east_deg,
    }


def _print_map(one: dict[str, Any]) -> None:
    print(
        f"{one['id']}  {one['bytes'] / 1e6:.1f} MB  zoom {one['min_zoom']} to {one['max_zoom']}  "
        f"{one['south_deg']:.4f} to {one['north_deg']:.4f} N, "
        f"{one['west_deg']:.4f} to {one['east_deg']:.4f} E  {one['title']}"
    )
