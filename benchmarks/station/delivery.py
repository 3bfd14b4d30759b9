"""What a delivery of a long deployment takes: written, checked and packed in a worker process.

``python -m benchmarks.station.delivery ROWS`` measures one size and prints its rows.
"""

import os
import subprocess
import sys
import tempfile
import time
import zipfile
from contextlib import closing
from pathlib import Path
from typing import Any, Final

from sqlalchemy import text
from sqlalchemy.orm import Session

from benchmarks.calibration import NotMeasuredError
from benchmarks.station.memory import peak_mb
from benchmarks.station.samples import fill_samples
from db.query.fleet.robots import add_robot
from db.store import Store
from tests.db.conftest import robot_record

MODULE: Final = "benchmarks.station.delivery"
ROWS = 1_000_000
TIME_BAR_S, MEMORY_BAR_MB, REPORT_BAR_MB = 90.0, 200.0, 5.0
MORE_ROWS: Final = "DELIVERY_ROWS"
"""In the environment, how many rows another delivery has, such as 10000000; it has no bars."""
_STATES = """
INSERT INTO state_report (robot_key, measured_at, received_at, mode, north_m, east_m, depth_m,
                          position_std_m, has_fix, roll_rad, pitch_rad, heading_rad,
                          net_buoyancy_kg, mass_position_m, tail_rad, battery_v)
SELECT 1, measured_at, measured_at, 2, north_mm / 1000.0, east_mm / 1000.0, depth_mm / 1000.0,
       position_std_um / 1000000.0, (sequence % 3600) = 0, 0.0, 0.4, 1.0, 0.01, 0.002, 0.0, 11.1
FROM sample WHERE channel_key = (SELECT min(channel_key) FROM sample)
"""


def measure() -> list[dict[str, Any]]:
    more = int(os.environ.get(MORE_ROWS, "0"))
    return measured(ROWS) + (measured(more, has_bars=False) if more else [])


def measured(rows: int, *, has_bars: bool = True) -> list[dict[str, Any]]:
    """Pack a delivery of so many rows; one that has no bars must only be whole."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _fill(folder, rows)
        command = [sys.executable, "-m", MODULE, "--in", str(folder)]
        child = subprocess.run(command, check=False, capture_output=True, text=True)
        if child.returncode:
            raise NotMeasuredError(child.stderr.strip().splitlines()[-1])
        took_s, memory_mb, size_mb, report_mb = map(float, child.stdout.split())
    what = f"delivery of {rows:,} rows"
    bars = (TIME_BAR_S, MEMORY_BAR_MB, REPORT_BAR_MB) if has_bars else (None, None, None)
    return [
        _row(f"{what}: written, checked, packed", took_s, "s", bars[0]),
        _row(f"{what}: more memory at most", memory_mb, "MB", bars[1]),
        _row(f"{what}: its report", report_mb, "MB", bars[2]),
        _row(f"{what}: the ZIP", size_mb, "MB", None),
    ]


def _row(name: str, value: float, unit: str, bar: float | None) -> dict[str, Any]:
    met = None if bar is None else value <= bar
    return {"area": "delivery", "name": name, "value": value, "unit": unit, "bar": bar, "met": met}


def _fill(folder: Path, rows: int) -> None:
    with closing(Store.open(f"sqlite:///{folder / 'station.sqlite3'}")) as store:
        store.change(lambda session: fill_deployment(session, rows)).result()


def fill_deployment(session: Session, rows: int) -> None:
    """Add a robot whose deployment has two channels and a state a second."""
    add_robot(session, robot_record())
    fill_samples(session, rows, rows)
    session.execute(text(_STATES))


def _pack(folder: Path) -> None:
    """Pack the delivery in this process, and print what it took."""
    from server.delivery.package import task as package_task
    from server.delivery.package.order import PackageOrder
    from tests.server.delivery.written import order_for

    url = f"sqlite:///{folder / 'station.sqlite3'}"
    with closing(Store.open(url)) as store:
        order = order_for(store, url, folder / "delivery", "mini-1")
    before_mb, begun_s = peak_mb(), time.perf_counter()
    kept = package_task.run(
        PackageOrder(order, None, has_journal=False, data_dir=folder), print_news, lambda: False
    )
    took_s = time.perf_counter() - begun_s
    report = Path(package_task.package_path(order.folder, kept.sha256))
    print(took_s, peak_mb() - before_mb, kept.bytes / 1e6, _report_mb(report))


def print_news(news: tuple[float, str]) -> None:
    """Say how far it is, beside the figures."""
    sys.stderr.write(f"{time.perf_counter():.1f} {news[0]:.2f} {news[1]} {peak_mb():.0f} MB\n")


def _report_mb(package: Path) -> float:
    with zipfile.ZipFile(package) as archive:
        (report,) = [one for one in archive.infolist() if one.filename.endswith("report.html")]
        return report.file_size / 1e6


if __name__ == "__main__":
    if sys.argv[1] == "--in":
        _pack(Path(sys.argv[2]))
    else:
        for row in measured(int(sys.argv[1])):
            print(f"{row['name']}: {row['value']:.1f} {row['unit']} (bar {row['bar']})")
