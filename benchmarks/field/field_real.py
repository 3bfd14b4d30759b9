"""Maps of a real glider's deployment, scored on samples held out."""

import json
import statistics
from pathlib import Path

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.channel import CHANNELS
from autonomy.field.learning.recorded import RecordedFit, fit_recording
from benchmarks.field.field import at_most, row

AREA = "field_real"
DEPLOYMENT = Path(__file__).parents[3] / "shared" / "data" / "eva035_chl_temp.csv"
SPLITS = 3
RMSE_BAR, NLPD_BAR = 0.31, 0.0
COVERAGE_BAR = 0.80


def measure() -> list[dict[str, object]]:
    """Learn both variables on several splits; every figure is the median over these."""
    if not DEPLOYMENT.exists():
        absent = f"{DEPLOYMENT.name} is not on this machine"
        return [row(AREA, "maps of a real deployment", None, absent, None, None)]
    points, values = read(DEPLOYMENT)
    rows: list[dict[str, object]] = []
    for variable in ("chlorophyll", "temperature"):
        fits = [
            fit_recording(CHANNELS[variable], points, values[variable], np.random.default_rng(seed))
            for seed in range(SPLITS)
        ]
        rows += lines(variable, fits)
    return rows


def lines(variable: str, fits: list[RecordedFit]) -> list[dict[str, object]]:
    """Make the lines of one variable."""
    is_bar = variable == "chlorophyll"
    scores = [fit.scores for fit in fits]
    rmse = statistics.median(one.rmse for one in scores)
    nlpd = statistics.median(one.nlpd for one in scores)
    coverage = statistics.median(one.coverage_90 for one in scores)
    what = f"{variable}, {fits[0].test} samples held out"
    least = None if is_bar else COVERAGE_BAR
    return [
        at_most(AREA, f"error: {what}", rmse, "sd", RMSE_BAR if is_bar else None),
        at_most(AREA, f"log density lost: {what}", nlpd, "nats", NLPD_BAR if is_bar else None),
        row(
            AREA,
            f"coverage of 90 %: {what}",
            coverage,
            "",
            least,
            None if least is None else coverage >= least,
        ),
    ]


def read(path: Path) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return positions on a local tangent plane, ``(n, 3)``, m, and values by variable."""
    rows = np.genfromtxt(path, delimiter=",", names=True)
    latitude, longitude = np.radians(rows["latitude"]), np.radians(rows["longitude"])
    north = (latitude - latitude[0]) * 6.371e6
    east = (longitude - longitude[0]) * 6.371e6 * np.cos(latitude[0])
    points = np.column_stack([north, east, rows["depth"]])
    return points, {name: rows[name] for name in ("chlorophyll", "temperature")}


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
