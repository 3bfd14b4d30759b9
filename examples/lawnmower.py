"""Draws a lawnmower over an area by REST, shows what it costs, and makes a plan of it.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/lawnmower.py --robot grace-1 --south 150 --north 350 --west 150 --east 350

Needs only httpx, and rest.py beside it. Nothing is sent to the robot unless --send is given.
"""

import argparse
import os
import sys
import time

import httpx
from rest import get, post


def main() -> int:
    """Draw what the command line names."""
    arguments = parse()
    headers = {"Authorization": f"Bearer {os.environ['GRACE_TOKEN']}"}
    with httpx.Client(base_url=arguments.url, headers=headers, timeout=30.0) as station:
        body = {"name": arguments.name, "document": document(arguments)}
        design = post(station, f"/api/robots/{arguments.robot}/designs", body)
        if not tell(get(station, f"/api/designs/{design['id']}/check")):
            return 1
        plan = post(station, f"/api/designs/{design['id']}/plan")["id"]
        found = wait_for_draft(station, plan)
        print(f"{plan}: {(found['rehearsal'] or {}).get('message', 'not rehearsed')}")
        if not arguments.send:
            print("nothing was sent; add --send to send it")
            return 0
        post(station, f"/api/plans/{plan}/upload")
        print(f"{plan} is on its way to {arguments.robot}")
        return 0


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--robot", default="grace-1")
    parser.add_argument("--name", default="Lawnmower")
    for side in ("south", "north", "west", "east"):
        parser.add_argument(f"--{side}", type=float, required=True, help="m in the water's frame")
    parser.add_argument("--spacing-m", type=float, help="by default the map's correlation length")
    parser.add_argument("--deep-m", type=float, help="deep turn; by default that of surveys")
    parser.add_argument("--send", action="store_true", help="really send it")
    return parser.parse_args()


def document(arguments: argparse.Namespace) -> dict:
    """Return the design."""
    south, north, west, east = arguments.south, arguments.north, arguments.west, arguments.east
    corners = ((south, west), (north, west), (north, east), (south, east))
    area = [{"north_m": north_m, "east_m": east_m} for north_m, east_m in corners]
    content = {"kind": "lawnmower", "area": area, "spacing_m": arguments.spacing_m}
    return {"content": content, "manner": {"deep_m": arguments.deep_m}}


def tell(outline: dict) -> bool:
    """Print what a design costs; tell whether nothing speaks against it."""
    account = outline["account"]
    if account is not None:
        print(
            f"{len(outline['legs'])} legs, {account['distance_m']:.0f} m, "
            f"{account['duration_s'] / 3600.0:.1f} h, {account['surfacings']} surfacings"
        )
    for note in (*outline["notes"], *outline["violations"]):
        print(f"  {note['message']}")
    return account is not None and not outline["violations"]


def wait_for_draft(station: httpx.Client, plan: str) -> dict:
    """Wait until a plan was flown ahead."""
    while True:
        found = get(station, f"/api/plans/{plan}")
        if found["state"] != "planning":
            return found
        time.sleep(1.0)


if __name__ == "__main__":
    sys.exit(main())
