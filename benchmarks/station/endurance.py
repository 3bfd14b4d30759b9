"""Whether memory stays where it is: a demo left running, with robots that fly and one open page.

``python -m benchmarks.station.endurance`` runs 72 minutes at speed 20, which is a day of the
robots. Station, simulator and page are looked at every 30 s; ``build/endurance.json`` holds what
was seen and is written anew at each look, ``build/endurance.md`` is the report.

Memory is what is resident and mirrors no file. What grows is judged after the first tenth, by the
slope of Theil and Sen, which a single large sample does not move.
"""

import argparse
import contextlib
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import httpx
from scipy.stats import theilslopes

from benchmarks.station.endurance_flight import KeptFlying
from benchmarks.station.endurance_sample import Sampler
from benchmarks.station.plain_page import PlainPage, plain_page
from tests.browser.walk import CHROMIUM
from tests.e2e.demo import Demo

MINUTES: Final = 72.0
SPEED: Final = 20.0
SAMPLE_PERIOD_S: Final = 30.0
FLIGHT_PERIOD_S: Final = 3.0
FIRST_PART: Final = 0.1
"""Of the run, in which caches fill and workers start."""
GROWTH_BAR: Final = 0.05
SAMPLES_MIN: Final = 5
ROBOTS: Final = ("mini-1", "grace-1")
PAGE: Final = "/robot/mini-1"
JUDGED: Final = {
    "station_mb": "station, without its workers",
    "station_all_mb": "station and its workers",
    "simulator_mb": "simulator",
    "page_mb": "process of the page",
    "page_heap_mb": "objects of the page's scripts",
}
TOLD: Final = {
    "workers_mb": "workers of the station",
    "maps_mb": "live maps, within the station, which fill up and are bounded",
    "station_other_mb": "station without workers and maps",
    "station_rss_mb": "station with the files that it maps",
    "browser_all_mb": "all processes of the browser",
    "page_nodes": "nodes of the page",
    "station_fds": "open files of the station",
    "station_threads": "threads of the station",
    "simulator_fds": "open files of the simulator",
    "simulator_threads": "threads of the simulator",
    "database_mb": "database with its log",
}
"""What is no memory of these three, or is meant to grow."""
OUTPUT: Final = Path("build/endurance.json")
REPORT: Final = Path("build/endurance.md")


def main(words: list[str]) -> int:
    """Run, and say whether something grew."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=MINUTES, help="how long (default: 72)")
    parser.add_argument("--data", type=Path, help="an empty data folder, which is kept")
    arguments = parser.parse_args(words)
    if CHROMIUM is None:
        print("There is no chromium on this machine: the page cannot be watched.")
        return 2
    OUTPUT.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="grace-endurance-") as own:
        seen = _left_running(arguments.data or Path(own), 60.0 * arguments.minutes)
    rows = judged(seen["samples"])
    REPORT.write_text(report(seen, rows))
    print(REPORT.read_text())
    return 0 if all(row["met"] is not False for row in rows) and not seen["restarts"] else 1


def _left_running(data: Path, length_s: float) -> dict[str, Any]:
    options = ("--speed", f"{SPEED:g}", "--robots", ",".join(ROBOTS))
    with Demo(data, *options) as demo, plain_page(demo.sign_in_url) as page:
        page.wait_for("location.pathname == '/' && document.body.innerText.includes('Live')")
        _share_session(page, demo)
        page.open(f"{demo.url}{PAGE}")
        page.wait_for_scene()
        flights = [KeptFlying(demo.client, robot) for robot in ROBOTS]
        return _watched(demo, flights, Sampler(data, page.heap, lambda: _maps_mb(demo)), length_s)


def _maps_mb(demo: Demo) -> float:
    """Return what the station tells that its live maps keep; 0 while it does not answer."""
    with contextlib.suppress(httpx.HTTPError):
        for line in demo.client.get("/metrics").raise_for_status().text.splitlines():
            if line.startswith("grace_map_memory_bytes "):
                return float(line.split()[1]) / 1e6
    return 0.0


def _share_session(page: PlainPage, demo: Demo) -> None:
    """Let the client of the demo ask as the page does: the printed address opens one session."""
    for name, value in page.cookies().items():
        demo.client.cookies.set(name, value)
    demo.client.headers["X-CSRF-Token"] = demo.get("/api/session")["csrf_token"]


def _watched(
    demo: Demo, flights: list[KeptFlying], sampler: Sampler, length_s: float
) -> dict[str, Any]:
    """Look and fly by turns until the time is over; return everything that was seen."""
    processes = demo.children()
    begun_s, next_s = time.monotonic(), 0.0
    seen: dict[str, Any] = {"speed": SPEED, "page": PAGE, "restarts": 0, "samples": []}
    while (now_s := time.monotonic() - begun_s) < length_s:
        for flight in flights:
            flight.step()
        children = demo.children()
        if children != processes:
            seen["restarts"] += 1
            processes = children
        if now_s >= next_s and len(processes) == len(("serve", "simulate")):
            seen["samples"].append(sampler.sample(now_s, processes["serve"], processes["simulate"]))
            seen["flights"] = {flight.robot: flight.told() for flight in flights}
            OUTPUT.write_text(json.dumps(seen, indent=1) + "\n")
            next_s += SAMPLE_PERIOD_S
        time.sleep(FLIGHT_PERIOD_S)
    return seen


def judged(samples: list[dict[str, float]]) -> list[dict[str, Any]]:
    """Return for each figure what it grew by after the first tenth, as a part of its level.

    ``growth`` is the robust slope times the time that it was watched, ``highest`` how far the
    largest sample lies above the median of the next tenth, both as parts of that median.
    """
    rows: list[dict[str, Any]] = []
    end_s = samples[-1]["at_s"] if samples else 0.0
    later = [one for one in samples if one["at_s"] >= FIRST_PART * end_s]
    for name, what in (JUDGED | TOLD).items():
        row: dict[str, Any] = {"name": name, "what": what, "growth": None, "met": None}
        rows.append(row)
        if len(later) < SAMPLES_MIN:
            continue
        at_s, values = [one["at_s"] for one in later], [one[name] for one in later]
        early = sorted(values[: max(len(values) // 9, 3)])
        level = early[len(early) // 2] or 1.0
        slope: Any = theilslopes(values, at_s)[0]
        growth = float(slope) * (at_s[-1] - at_s[0]) / level
        row |= {"level": level, "last": values[-1], "growth": growth}
        row["highest"] = max(values) / level - 1.0
        if name in JUDGED:
            row["met"] = growth < GROWTH_BAR
    return rows


def report(seen: dict[str, Any], rows: list[dict[str, Any]]) -> str:
    """Return the report, in Markdown."""
    minutes = seen["samples"][-1]["at_s"] / 60.0 if seen["samples"] else 0.0
    days_h = minutes * seen["speed"] / 60.0
    lines = [
        "# Left running",
        "",
        f"{minutes:.1f} minutes at speed {seen['speed']:g}: {days_h:.1f} h of the robots. "
        f"Page {seen['page']} with its 3D view. Restarts of processes: {seen['restarts']}.",
        "",
        "Growth is the slope of Theil and Sen after the first tenth times the time, as a part of "
        f"the level then; the bar is {GROWTH_BAR:.0%}. Memory is resident and mirrors no file.",
        "",
        "| what | level | last | growth | highest | met |",
        "|---|---:|---:|---:|---:|---|",
    ]
    for row in rows:
        if row["growth"] is None:
            lines.append(f"| {row['what']} | | | too few samples | | |")
            continue
        met = {True: "yes", False: "NO", None: ""}[row["met"]]
        lines.append(
            f"| {row['what']} (`{row['name']}`) | {row['level']:.1f} | {row['last']:.1f} "
            f"| {row['growth']:+.1%} | {row['highest']:+.1%} | {met} |"
        )
    lines += ["", "| robot | flights done | failed | batteries changed | refused, last word |"]
    lines.append("|---|---:|---:|---:|---|")
    for robot, told in seen.get("flights", {}).items():
        refused = f"{told['refused']}; {told['last_refusal'] or 'none'}"
        counts = f"{told['done']} | {told['failed']} | {told['batteries']}"
        lines.append(f"| {robot} | {counts} | {refused} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
