"""Fixes by cameras as CSV, the refused ones with their reason."""

import csv
import io
from collections.abc import Generator, Iterator
from datetime import datetime
from itertools import islice
from typing import Final

from sqlalchemy.orm import Session

from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from db.column import microseconds
from db.query.camera.fixes import FixRecord, iterate_fixes
from db.query.fleet.robots import RobotRecord

COLUMNS: Final = (
    "time", "received", "sent", "latitude", "longitude", "north_m", "east_m", "depth_m",
    "covariance_xx_m2", "covariance_xy_m2", "covariance_xz_m2", "covariance_yy_m2",
    "covariance_yz_m2", "covariance_zz_m2", "heading_rad", "heading_std_rad", "roll_rad",
    "pitch_rad", "tilt_std_rad", "cameras", "tags", "rms", "quality", "reason", "calibration",
)  # fmt: skip
"""What is not known is left empty."""
_BLOCK_ROWS: Final = 500


def fix_csv_blocks(
    session: Session, robot: RobotRecord, site: Site, start: datetime, end: datetime | None
) -> Generator[str]:
    """Yield where cameras found a robot as CSV.

    Args:
        session: A reading session.
        robot: Whose fixes.
        site: The water that north and east are of.
        start: The first moment.
        end: The last moment; None for no limit.
    """
    if robot.simulated:
        yield "# SIMULATION: this robot does not exist\n"
    yield (
        f"# {robot.id}: times Unix s (UTC), latitude and longitude deg, depth below the"
        " surface, covariance of north, east and depth, rms in standard deviations\n"
    )
    yield ",".join(COLUMNS) + "\n"
    found: Iterator[FixRecord] = iter(iterate_fixes(session, robot.id, start, end))
    while block := list(islice(found, _BLOCK_ROWS)):
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(_row(one, site) for one in block)
        yield text.getvalue()


def _row(record: FixRecord, site: Site) -> list[str]:
    fix = record.fix
    north, east, depth = fix.ned_m
    origin = site.origin_latitude_deg, site.origin_longitude_deg
    latitude, longitude = wgs84_from_ned((north, east), *origin).tolist()
    angles = (fix.heading_rad, fix.heading_std_rad, fix.roll_rad, fix.pitch_rad, fix.tilt_std_rad)
    return [
        *map(_seconds, (fix.measured_at, record.received_at, record.sent_at)),
        f"{latitude:.8f}",
        f"{longitude:.8f}",
        *(f"{place:.4f}" for place in (north, east, depth)),
        *(f"{one:.4g}" for one in fix.covariance_m2),
        *("" if one is None else f"{one:.4f}" for one in angles),
        ";".join(fix.cameras),
        ";".join(map(str, fix.tags)),
        f"{fix.rms:.2f}",
        fix.quality,
        fix.reason,
        "" if fix.calibration is None else str(fix.calibration),
    ]


def _seconds(at: datetime | None) -> str:
    return "" if at is None else f"{microseconds(at) / 1e6:.6f}"
