"""The rooms of the station: few arrows between them, none upward, no circle, and small folders.

An arrow is an import from one folder of ``server`` into another, counted once however often it is
made. Run it with ``-s`` to see the count.
"""

import ast
import inspect
import sys
from collections import defaultdict
from pathlib import Path

from server.access.rate import calls_of
from server.station import ROUTERS

SERVER = Path(__file__).parents[2] / "server"
ORDER = (
    "base", "access", "watch", "system", "backup", "demo", "base_map", "vehicle", "water", "camera",
    "fleet",
    "deployment", "link", "satellite", "lease", "command", "drive", "fix", "current", "map", "tag",
    "battery", "plan",
    "plan_file", "design", "checklist", "transfer", "schedule", "target", "survey", "study",
    "prediction", "alarm", "notice", "scene", "replay", "recording_file", "recording", "logbook",
    "delivery", "analysis", "storage", "cli",
)  # fmt: skip
"""Rooms from the lowest up: each stands on those before it alone."""
ARROWS_MAX = 215
FILES_MAX = 25
STATION_LINES_MAX = 175


def arrows() -> dict[tuple[str, str], list[str]]:
    """Return the modules that make each arrow, by the rooms from which and to which it goes."""
    found: dict[tuple[str, str], list[str]] = defaultdict(list)
    for path in SERVER.rglob("*.py"):
        parts = path.relative_to(SERVER).parts
        if len(parts) == 1:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("server."):
                room = (node.module or "").split(".")[1]
                if room in ORDER and room != parts[0]:
                    found[parts[0], room].append("/".join(parts))
    return found


def test_arrows_between_rooms_are_few_and_none_goes_up():
    found = arrows()
    rooms = {room for arrow in found for room in arrow}
    sys.stdout.write(f"\n{len(found)} arrows between {len(rooms)} rooms of the server\n")
    upward = {
        f"{above} -> {below}": makers
        for (above, below), makers in found.items()
        if ORDER.index(above) < ORDER.index(below)
    }
    # Where no arrow goes up, none can close a circle.
    assert not upward
    assert len(found) <= ARROWS_MAX
    assert len(rooms) <= 44


def test_every_room_has_its_place_and_fits_on_a_page():
    folders = {
        path.parent.relative_to(SERVER): len(list(path.parent.glob("*.py")))
        for path in SERVER.glob("*/**/__init__.py")
    }
    assert {folder.parts[0] for folder in folders} == set(ORDER)
    assert max(folders.values()) <= FILES_MAX


def test_station_only_puts_its_capabilities_together():
    assert len((SERVER / "station.py").read_text().splitlines()) < STATION_LINES_MAX
    missing = [
        room
        for room in ORDER
        if room not in {"base", "cli", "plan_file", "recording_file"}
        and not (SERVER / room / "install.py").exists()
    ]
    assert not missing


def test_no_function_that_a_route_depends_on_runs_in_a_thread():
    dependants = [
        (route.path, route.dependant)
        for router in ROUTERS
        for route in router.routes
        if hasattr(route, "dependant")
    ]
    functions = {
        (path, call)
        for path, dependant in dependants
        for call in calls_of(dependant)
        if inspect.isfunction(call)
    }
    assert len(functions) > len(dependants)
    in_a_thread = {
        f"{path}: {call.__qualname__}"
        for path, call in functions
        if not (inspect.iscoroutinefunction(call) or inspect.isasyncgenfunction(call))
    }
    assert not in_a_thread
