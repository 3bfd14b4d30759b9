"""Runs every benchmark, prints one table and writes ``build/bench.json``.

``python -m benchmarks.run [area ...]`` runs only the named areas. A row whose peer or compiler is
absent is kept, with ``met`` null and the reason in its unit; so is an area that came to no figure,
with ``met`` false. A bar that depends on the machine is
shown as it is on this one; ``ratio`` and its own bar, in yardsticks of ``benchmarks.calibration``,
mean the same on every machine.
"""

import importlib
import json
import os
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.calibration import NotMeasuredError

AREAS = {
    "vehicle": "benchmarks.flight.vehicle",
    "control": "benchmarks.flight.control",
    "actuator_flight": "benchmarks.flight.actuator_flight",
    "claims": "benchmarks.flight.claims",
    "estimation": "benchmarks.estimation.estimation",
    "estimation_hidden": "benchmarks.estimation.estimation_hidden",
    "identification": "benchmarks.estimation.identification",
    "identification_coverage": "benchmarks.estimation.identification_coverage",
    "lost_hours": "benchmarks.estimation.lost_hours",
    "lost_flights": "benchmarks.estimation.lost_flights",
    "energy_use": "benchmarks.estimation.energy_use",
    "field": "benchmarks.field.field",
    "field_speed": "benchmarks.field.field_speed",
    "field_learning": "benchmarks.field.field_learning",
    "field_real": "benchmarks.field.field_real",
    "field_quality": "benchmarks.field.field_quality",
    "field_current": "benchmarks.field.field_current",
    "field_threshold": "benchmarks.field.field_threshold",
    "currents": "benchmarks.field.currents",
    "planner": "benchmarks.planning.planner",
    "design_check": "benchmarks.planning.design_check",
    "tags": "benchmarks.field.tags",
    "camera_detection": "benchmarks.vision.detection",
    "camera_picture": "benchmarks.vision.picture",
    "own_camera": "benchmarks.vision.own_camera",
    "camera_dive": "benchmarks.vision.dive",
    "camera_watch": "benchmarks.vision.watch",
    "camera_load": "benchmarks.vision.load",
    "water": "benchmarks.planning.water",
    "base_map": "benchmarks.station.base_map",
    "expected_track": "benchmarks.flight.expected_track",
    "flight_ahead": "benchmarks.flight.flight_ahead",
    "tracking": "benchmarks.planning.tracking",
    "tracking_speed": "benchmarks.planning.tracking_speed",
    "tracking_predictive": "benchmarks.planning.tracking_predictive",
    "alarm": "benchmarks.station.alarm",
    "flood": "benchmarks.station.flood",
    "telemetry": "benchmarks.station.telemetry",
    "viewers": "benchmarks.station.viewers",
    "busy": "benchmarks.station.busy",
    "prune": "benchmarks.station.prune",
    "radio": "benchmarks.link.radio",
    "drive": "benchmarks.link.drive",
    "ingest": "benchmarks.station.ingest",
    "satellite": "benchmarks.link.satellite",
    "garbage": "benchmarks.link.garbage",
    "live": "benchmarks.station.live",
    "design_page": "benchmarks.station.design_page",
    "stored": "benchmarks.station.stored",
    "samples": "benchmarks.station.samples",
    "large": "benchmarks.station.large",
    "decisions": "benchmarks.station.decisions",
    "backup": "benchmarks.station.backup",
    "kills": "benchmarks.station.kills",
    "delivery": "benchmarks.station.delivery",
    "replay": "benchmarks.station.replay",
    "replay_page": "benchmarks.station.replay_page",
}
"""The module that measures each, in the order of the table."""
OUTPUT = Path("build/bench.json")


def main(areas: list[str]) -> int:
    unknown = sorted(set(areas) - set(AREAS))
    if unknown:
        print(f"unknown area {', '.join(unknown)}; there are {', '.join(AREAS)}")
        return 2
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the product and, here, its peers run
    rows: list[dict] = []
    for area in areas or AREAS:
        print(f"measuring {area}", flush=True)
        try:
            rows += importlib.import_module(AREAS[area]).measure()
        except NotMeasuredError as error:
            none = {"value": None, "unit": str(error), "bar": None, "met": False}
            rows.append({"area": area, "name": "no figure"} | none)
    OUTPUT.parent.mkdir(exist_ok=True)
    OUTPUT.write_text(json.dumps(rows, indent=1) + "\n")
    Console().print(table(rows))
    print(f"written to {OUTPUT}")
    return 0


def table(rows: list[dict]) -> Table:
    shown = Table(title="Measured against the bars")
    for column in ("area", "what", "value", "unit", "bar", "ratio", "its bar", "slower", "met"):
        is_number = column in {"value", "bar", "ratio", "its bar", "slower"}
        shown.add_column(column, justify="right" if is_number else "left")
    for row in rows:
        met = {True: "yes", False: "NO", None: "-"}[row["met"]]
        value = "-" if row["value"] is None else f"{row['value']:.4g}"
        bar = "" if row["bar"] is None else str(row["bar"])
        ratios = ("", "", "")
        if "calibration" in row:
            calibration, bar = row["calibration"], f"{row['bar']:.4g}"
            slower = f"{calibration['slowness']:.2f}, drift {calibration['drift']:.2f}"
            ratios = (f"{row['ratio']:.4g}", f"{row['ratio_bar']:.4g}", slower)
        shown.add_row(row["area"], row["name"], value, row["unit"], bar, *ratios, met)
    return shown


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
