"""Writes a deployment to files that other programs read."""

import json
from collections.abc import Generator, Iterable
from dataclasses import astuple
from itertools import groupby, islice
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from sqlalchemy.orm import Session

from autonomy.field.variable import VARIABLES
from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from db.column import microseconds
from db.query.actuator_reports import iterate_actuator_reports
from db.query.deployments import DeploymentRecord
from db.query.robots import RobotRecord
from db.query.samples import SampleRecord, iterate_samples, sampled_variables
from db.query.telemetry import track
from robot_link.report import ActuatorReport
from server.recording.table import COMMENT, POSITION_COLUMNS

TRACK_POINTS_MAX = 50_000
_BLOCK_ROWS = 500
ACTUATOR_COLUMNS = (
    "time", "received",
    *(
        f"{actuator}_{name}"
        for actuator in ("mass", "pump")
        for name in ("rate_share", "rate_std_octaves", "delay_s", "delay_std_s", "learned_age_s")
    ),
    "speed_share", "is_mass_off", "is_swinging", "stuck",
)  # fmt: skip
"""Columns of a file about actuators; what is not known is left empty."""


def csv_blocks(
    session: Session, deployment: DeploymentRecord, robot: RobotRecord
) -> Generator[str]:
    """Yield the deployment's samples as CSV that ``grace import`` takes back."""
    start, end, log = deployment.started_at, deployment.ended_at, deployment.log
    variables = deployment.variables or tuple(
        sorted(sampled_variables(session, robot.id, start=start, end=end, log=log))
    )
    units = ", ".join(f"{key} {VARIABLES[key].unit}" for key in variables if key in VARIABLES)
    yield _mark(robot) + (
        f"{COMMENT} {robot.id}, {deployment.id}: time Unix s (UTC), latitude deg, longitude deg, "
        f"depth m (positive down), {units}\n" + ",".join((*POSITION_COLUMNS, *variables)) + "\n"
    )
    samples = iterate_samples(session, robot.id, start=start, end=end, log=log)
    block: list[list[SampleRecord]] = []
    for _, together in groupby(samples, key=lambda sample: sample.measured_at):
        block.append(list(together))
        if len(block) == _BLOCK_ROWS:
            yield _csv_rows(block, robot.site, variables)
            block = []
    if block:
        yield _csv_rows(block, robot.site, variables)


def actuator_csv_blocks(
    session: Session, deployment: DeploymentRecord, robot: RobotRecord
) -> Generator[str]:
    """Yield what the robot said in a deployment of how its actuators follow, as CSV."""
    yield _mark(robot) + (
        f"{COMMENT} {robot.id}, {deployment.id}: times Unix s (UTC), rates as a share of the "
        "nominal one, delays s\n" + ",".join(ACTUATOR_COLUMNS) + "\n"
    )
    start, end = deployment.started_at, deployment.ended_at
    reports = iterate_actuator_reports(session, robot.id, start, end)
    while block := list(islice(reports, _BLOCK_ROWS)):
        yield "".join(map(_actuator_row, block))


def _actuator_row(report: ActuatorReport) -> str:
    cells = [f"{microseconds(at) / 1e6:.6f}" for at in (report.measured_at, report.received_at)]
    for following in (report.mass, report.pump):
        cells += ["" if one is None else repr(one) for one in astuple(following)]
    flags = (report.is_mass_off, report.is_swinging)
    cells += [repr(report.speed_share), *(str(int(flag)) for flag in flags)]
    return ",".join([*cells, ";".join(report.stuck)]) + "\n"


def geojson(session: Session, deployment: DeploymentRecord, robot: RobotRecord) -> str:
    """Return the track as a GeoJSON feature (RFC 7946); heights are negative depths."""
    coordinates, times = _track(session, deployment, robot)
    feature: dict[str, Any] = {
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": coordinates},
        "properties": {
            "name": deployment.title,
            "robot": robot.id,
            "deployment": deployment.id,
            "simulation": robot.simulated,
            "times": times,
        },
    }
    return json.dumps(feature)


def kml(session: Session, deployment: DeploymentRecord, robot: RobotRecord) -> str:
    """Return the track as KML; heights are negative depths."""
    coordinates, _ = _track(session, deployment, robot)
    points = " ".join(f"{lon:.7f},{lat:.7f},{height:.2f}" for lon, lat, height in coordinates)
    mark = "SIMULATION: " if robot.simulated else ""
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark>'
        f"<name>{escape(mark + deployment.title)}</name>"
        "<LineString><altitudeMode>absolute</altitudeMode>"
        f"<coordinates>{points}</coordinates></LineString>"
        "</Placemark></Document></kml>\n"
    )


def _mark(robot: RobotRecord) -> str:
    return f"{COMMENT} SIMULATION: this robot does not exist\n" if robot.simulated else ""


def _csv_rows(block: list[list[SampleRecord]], site: Site, variables: tuple[str, ...]) -> str:
    places = _wgs84(site, [samples[0].position_ned for samples in block])
    lines: list[str] = []
    for samples, (latitude_deg, longitude_deg) in zip(block, places, strict=True):
        values = {sample.variable: sample.value for sample in samples}
        cells = [
            f"{microseconds(samples[0].measured_at) / 1e6:.6f}",
            f"{latitude_deg:.8f}",
            f"{longitude_deg:.8f}",
            f"{samples[0].position_ned[2]:.3f}",
            *(repr(values[key]) if key in values else "" for key in variables),
        ]
        lines.append(",".join(cells) + "\n")
    return "".join(lines)


def _track(
    session: Session, deployment: DeploymentRecord, robot: RobotRecord
) -> tuple[list[list[float]], list[str]]:
    points = track(
        session, robot.id, deployment.started_at, deployment.ended_at, TRACK_POINTS_MAX
    ).points
    places = _wgs84(robot.site, [point.position_ned for point in points])
    coordinates = [
        [longitude_deg, latitude_deg, -point.position_ned[2]]
        for point, (latitude_deg, longitude_deg) in zip(points, places, strict=True)
    ]
    return coordinates, [point.measured_at.isoformat() for point in points]


def _wgs84(
    site: Site, positions: Iterable[tuple[float, float, float]]
) -> list[tuple[float, float]]:
    north_east = np.array([position[:2] for position in positions]).reshape(-1, 2)
    places = wgs84_from_ned(north_east, site.origin_latitude_deg, site.origin_longitude_deg)
    return [(float(latitude_deg), float(longitude_deg)) for latitude_deg, longitude_deg in places]
