"""Plans whenever a robot surfaces, by the station's events: nothing is polled, and none is missed.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/plan_on_surfacing.py --url http://127.0.0.1:8000 --robot mini-1

On each `robot.surfaced` it asks for a plan, waits for its dry run and prints what both say. With
--send the plan is sent and started; while another is flown it waits on board for the next
surfacing. --cursor FILE keeps the place in the event log, so that a script that was stopped goes on
after the last event that it has done. Needs only httpx, and rest.py beside it.
"""

import argparse
import os
import sys
from pathlib import Path

import httpx
from rest import get, post

WAIT_S = 20.0
"""The station answers at once when something happened, else after so long."""


def main() -> int:
    """Plan on every surfacing until enough were seen."""
    arguments = parse()
    headers = {"Authorization": f"Bearer {os.environ['GRACE_TOKEN']}"}
    cursor = begin(arguments.cursor)
    done = 0
    with httpx.Client(base_url=arguments.url, headers=headers, timeout=WAIT_S + 30.0) as station:
        while arguments.times == 0 or done < arguments.times:
            page = events(station, arguments.robot, cursor)
            for event in page["events"] if cursor is not None else ():
                data = event["data"]
                print(
                    f"{event['text']} Measured at {data['measured_at']}, "
                    f"received at {data['received_at']}, by {data['by']}.",
                    flush=True,
                )
                plan_once(station, arguments)
                done += 1
                keep(arguments.cursor, event["cursor"])
            cursor = page["next"]
            keep(arguments.cursor, cursor)
    return 0


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--robot", default="mini-1")
    parser.add_argument("--depth-m", type=float, default=0.5)
    parser.add_argument("--cursor", type=Path, help="file that keeps the place in the event log")
    parser.add_argument("--times", type=int, default=0, help="surfacings to plan on; 0 for ever")
    parser.add_argument("--send", action="store_true", help="really send what was planned")
    return parser.parse_args()


def events(station: httpx.Client, robot: str, cursor: int | None) -> dict:
    """Return what happened after a cursor, or where the log ends now."""
    query = {"robot": robot, "kind": "robot.surfaced"}
    if cursor is None:
        return get(station, "/api/events", **query, limit=1)
    return get(station, "/api/events", **query, after=cursor, wait_s=WAIT_S)


def begin(file: Path | None) -> int | None:
    """Return the cursor that was kept, None to begin now."""
    return int(file.read_text()) if file is not None and file.exists() else None


def keep(file: Path | None, cursor: int) -> None:
    """Keep the place in the log."""
    if file is not None:
        file.write_text(str(cursor))


def plan_once(station: httpx.Client, arguments: argparse.Namespace) -> None:
    """Plan a dive here, see what its dry run says, and send it if that is wanted."""
    here = get(station, f"/api/robots/{arguments.robot}/state")["position"]["ned_m"]
    north, east, _ = here
    legs = [
        {"kind": "dive", "end_ned": [north, east, arguments.depth_m]},
        {"kind": "dive", "end_ned": [north, east, 0.0]},
    ]
    body = {"kind": "primitives", "legs": legs}
    made = post(station, f"/api/robots/{arguments.robot}/plans", body)["id"]
    plan = drafted(station, made)
    dry_run = plan["rehearsal"] or {}
    print(
        f"{made}: {plan['account']['energy']:.1f} energy units, "
        f"{plan['account']['duration_s']:.0f} s; {dry_run.get('message', 'no dry run')}",
        flush=True,
    )
    if not arguments.send:
        print("nothing was sent; add --send to fly it", flush=True)
        return
    transfer = post(station, f"/api/plans/{made}/upload", {"start": True})["transfer"]
    print(get(station, f"/api/transfers/{transfer}")["text"], flush=True)


def drafted(station: httpx.Client, plan: str) -> dict:
    """Return a plan once it is a draft and was flown ahead, told by the event log."""
    cursor = get(station, "/api/events", kind="plan.draft", limit=1)["next"]
    while True:
        found = get(station, f"/api/plans/{plan}")
        if found["state"] not in {"planning", "draft"}:
            sys.exit(f"{plan}: {found['message']}")
        dry_run = found["rehearsal"]
        if found["state"] == "draft" and (dry_run is None or dry_run["state"] != "working"):
            return found
        cursor = get(station, "/api/events", after=cursor, wait_s=1.0)["next"]


if __name__ == "__main__":
    sys.exit(main())
