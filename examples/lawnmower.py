"""Draws a lawnmower over an area, shows what it costs, and makes a plan of it.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/lawnmower.py --robot grace-1 --south 150 --north 350 --west 150 --east 350

Needs grace_client. Nothing is sent to the robot unless --send is given.
"""

import argparse
import os
import sys

from grace_client import Station, models


def main() -> int:
    """Draw what the command line names."""
    arguments = parse()
    token = os.environ["GRACE_TOKEN"]
    with Station(arguments.url, token, may_send=arguments.send) as station:
        designs = station.ask.designs
        drawn = models.NewDesign(name=arguments.name, document=document(arguments))
        design = designs.create_design(arguments.robot, drawn)
        if not tell(designs.check_design(design.id)):
            return 1
        plan = station.wait_until_planned(designs.make_plan(design.id).id)
        dry_run = plan.rehearsal
        print(f"{plan.id}: {'not flown ahead' if dry_run is None else dry_run.message}")
        if not arguments.send:
            print("nothing was sent; add --send to send it")
            return 0
        print(station.send(plan.id).text)
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


def document(arguments: argparse.Namespace) -> models.DesignInput:
    """Return the design."""
    south, north, west, east = arguments.south, arguments.north, arguments.west, arguments.east
    corners = ((south, west), (north, west), (north, east), (south, east))
    content = models.LawnmowerInput(
        kind="lawnmower",
        area=[models.Spot(north_m=north_m, east_m=east_m) for north_m, east_m in corners],
        spacing_m=arguments.spacing_m,
    )
    manner = models.MannerInput(deep_m=arguments.deep_m)
    return models.DesignInput(content=content, manner=manner)


def tell(outline: models.OutlineView) -> bool:
    """Print what a design costs; tell whether nothing speaks against it."""
    account = outline.account
    if account is not None:
        print(
            f"{len(outline.legs)} legs, {account.distance_m:.0f} m, "
            f"{account.duration_s / 3600.0:.1f} h, {account.surfacings} surfacings"
        )
    for note in (*outline.notes, *outline.violations):
        print(f"  {note.message}")
    return account is not None and not outline.violations


if __name__ == "__main__":
    sys.exit(main())
