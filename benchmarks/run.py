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

AREAS = (
    "vehicle",
    "control",
    "actuator_flight",
    "claims",
    "estimation",
    "estimation_hidden",
    "identification",
    "identification_coverage",
    "field",
    "field_speed",
    "field_learning",
    "field_real",
    "field_quality",
    "field_current",
    "field_threshold",
    "currents",
    "planner",
    "expected_track",
    "tracking",
    "tracking_speed",
    "tracking_predictive",
    "telemetry",
    "radio",
    "ingest",
    "satellite",
    "garbage",
    "live",
    "stored",
)
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
            rows += importlib.import_module(f"benchmarks.{area}").measure()
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
