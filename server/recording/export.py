"""Writes a deployment to files that other programs read."""

import json
from collections.abc import Generator, Iterable, Mapping
from dataclasses import astuple, dataclass
from itertools import groupby, islice
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from sqlalchemy.orm import Session

from autonomy.channel import Channel
from autonomy.frames import wgs84_from_ned
from autonomy.seawater import DERIVED, can_derive
from autonomy.site import Site
from db.column import microseconds, moment
from db.query.fleet.deployments import DeploymentRecord
from db.query.fleet.robots import RobotRecord
from db.query.measured.actuator_reports import iterate_actuator_reports
from db.query.measured.derived import derived_columns
from db.query.measured.samples import SampleRecord, iterate_samples, sampled_variables
from db.query.measured.telemetry import track
from db.query.storage.told import pruned_stretches
from robot_link.report import ActuatorReport
from server.base.channels import catalogue_in
from server.recording.table import COMMENT, DERIVED_COLUMN, POSITION_COLUMNS
from server.water import kml_text

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


@dataclass(frozen=True, slots=True)
class _Row:
    """What was measured at one moment, and what follows of it."""

    at_us: int
    latitude_deg: float
    longitude_deg: float
    depth_m: float
    values: Mapping[str, float]
    """By the keys of their channels."""


class _Measured:
    """The samples of a deployment with their derived channels, read block by block."""

    def __init__(self, session: Session, deployment: DeploymentRecord, robot: RobotRecord) -> None:
        self._session, self._deployment, self._robot = session, deployment, robot
        start, end, log = deployment.begun_at, deployment.last_at, deployment.log
        self.variables = deployment.variables or tuple(
            sorted(sampled_variables(session, robot.id, start=start, end=end, log=log))
        )
        derived = {
            key: derived_columns(session, (robot.id,), key, start, end, log)
            for key in DERIVED
            if can_derive(key, set(self.variables))
        }
        self.computed = {
            key: dict(zip(found.measured_at_us.tolist(), found.value.tolist(), strict=True))
            for key, found in derived.items()
        }
        """Values by the time of their samples, by channel."""
        known = catalogue_in(session)
        self.channels = {
            key: known[key] for key in (*self.variables, *self.computed) if key in known
        }

    def blocks(self) -> Generator[list[_Row]]:
        """Yield what was measured, in the order of time."""
        deployment = self._deployment
        samples = iterate_samples(
            self._session,
            self._robot.id,
            start=deployment.begun_at,
            end=deployment.last_at,
            log=deployment.log,
        )
        moments = (list(one) for _, one in groupby(samples, key=lambda one: one.measured_at))
        while block := list(islice(moments, _BLOCK_ROWS)):
            places = _wgs84(deployment.site, [samples[0].position_ned for samples in block])
            yield [self._row(one, *place) for one, place in zip(block, places, strict=True)]

    def _row(self, samples: list[SampleRecord], latitude_deg: float, longitude_deg: float) -> _Row:
        at_us = microseconds(samples[0].measured_at)
        values = {sample.variable: sample.value for sample in samples}
        values |= {key: found[at_us] for key, found in self.computed.items() if at_us in found}
        return _Row(at_us, latitude_deg, longitude_deg, samples[0].position_ned[2], values)


def csv_blocks(
    session: Session, deployment: DeploymentRecord, robot: RobotRecord
) -> Generator[str]:
    """Yield the deployment's samples as CSV that ``grace import`` takes back."""
    measured = _Measured(session, deployment, robot)
    units = ", ".join(
        f"{DERIVED_COLUMN if key in measured.computed else ''}{_unit_of(channel)}"
        for key, channel in measured.channels.items()
    )
    derived = tuple(f"{DERIVED_COLUMN}{key}" for key in measured.computed)
    columns = (*POSITION_COLUMNS, *measured.variables, *derived)
    yield _mark(robot) + _pruned(session, deployment, robot, "samples")
    yield (
        f"{COMMENT} {robot.id}, {deployment.id}: time Unix s (UTC), latitude deg, longitude deg, "
        f"depth m (positive down), {units}\n" + ",".join(columns) + "\n"
    )
    keys = (*measured.variables, *measured.computed)
    for block in measured.blocks():
        yield "".join(_csv_row(row, keys) for row in block)


def _csv_row(row: _Row, keys: Iterable[str]) -> str:
    cells = [
        f"{row.at_us / 1e6:.6f}",
        f"{row.latitude_deg:.8f}",
        f"{row.longitude_deg:.8f}",
        f"{row.depth_m:.3f}",
        *(repr(row.values[key]) if key in row.values else "" for key in keys),
    ]
    return ",".join(cells) + "\n"


def _unit_of(channel: Channel) -> str:
    name = "" if channel.standard_name is None else f" ({channel.standard_name})"
    return f"{channel.key} {channel.unit}{name}"


def actuator_csv_blocks(
    session: Session, deployment: DeploymentRecord, robot: RobotRecord
) -> Generator[str]:
    """Yield what the robot said in a deployment of how its actuators follow, as CSV."""
    yield _mark(robot) + _pruned(session, deployment, robot, "actuators")
    yield (
        f"{COMMENT} {robot.id}, {deployment.id}: times Unix s (UTC), rates as a share of the "
        "nominal one, delays s\n" + ",".join(ACTUATOR_COLUMNS) + "\n"
    )
    start, end = deployment.begun_at, deployment.last_at
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
    places = ((lon, lat, height) for lon, lat, height in coordinates)
    mark = "SIMULATION: " if robot.simulated else ""
    line = kml_text.line(mark + deployment.title, kml_text.coordinates(places, 7, 2))
    return f"{kml_text.BEGIN}{line}{kml_text.END}"


def geojson_sample_blocks(
    session: Session, deployment: DeploymentRecord, robot: RobotRecord
) -> Generator[str]:
    """Yield the samples as a GeoJSON collection of points, with values by channel."""
    measured = _Measured(session, deployment, robot)
    head = {
        "name": deployment.title,
        "robot": robot.id,
        "deployment": deployment.id,
        "simulation": robot.simulated,
        "units": {key: channel.unit for key, channel in measured.channels.items()},
        "derived": list(measured.computed),
    }
    yield f'{{"type": "FeatureCollection", "properties": {json.dumps(head)}, "features": ['
    comma = ""
    for block in measured.blocks():
        yield comma + ",\n".join(json.dumps(_point(row)) for row in block)
        comma = ",\n"
    yield "]}\n"


def _point(row: _Row) -> dict[str, Any]:
    place = [round(row.longitude_deg, 8), round(row.latitude_deg, 8), -round(row.depth_m, 3)]
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": place},
        "properties": {"time": moment(row.at_us).isoformat(), **row.values},
    }


def kml_sample_blocks(
    session: Session, deployment: DeploymentRecord, robot: RobotRecord
) -> Generator[str]:
    """Yield the samples as KML placemarks, with values by channel as their extended data."""
    measured = _Measured(session, deployment, robot)
    mark = "SIMULATION: " if robot.simulated else ""
    fields = "".join(
        f'<SimpleField type="double" name="{key}">'
        f"<displayName>{escape(_named(channel, key in measured.computed))}</displayName>"
        "</SimpleField>"
        for key, channel in measured.channels.items()
    )
    yield (
        f"{kml_text.BEGIN}"
        f'<name>{escape(mark + deployment.title)}</name><Schema id="sample">{fields}</Schema>\n'
    )
    for block in measured.blocks():
        yield "".join(map(_placemark, block))
    yield kml_text.END


def _named(channel: Channel, is_derived: bool) -> str:
    return f"{channel.title}, {channel.unit}" + (", derived" if is_derived else "")


def _placemark(row: _Row) -> str:
    values = "".join(
        f'<SimpleData name="{key}">{value!r}</SimpleData>' for key, value in row.values.items()
    )
    place = f"{row.longitude_deg:.8f},{row.latitude_deg:.8f},{-row.depth_m:.3f}"
    return (
        f"<Placemark><TimeStamp><when>{moment(row.at_us).isoformat()}</when></TimeStamp>"
        f'<ExtendedData><SchemaData schemaUrl="#sample">{values}</SchemaData></ExtendedData>'
        "<Point><altitudeMode>absolute</altitudeMode>"
        f"<coordinates>{place}</coordinates></Point></Placemark>\n"
    )


def _pruned(session: Session, deployment: DeploymentRecord, robot: RobotRecord, kind: str) -> str:
    """Return what of a deployment is no longer all there, a comment a sentence."""
    start, end = deployment.begun_at, deployment.last_at
    found = pruned_stretches(session, robot.id, (kind,), start, end)
    return "".join(f"{COMMENT} {one.text}\n" for one in found)


def _mark(robot: RobotRecord) -> str:
    return f"{COMMENT} SIMULATION: this robot does not exist\n" if robot.simulated else ""


def _track(
    session: Session, deployment: DeploymentRecord, robot: RobotRecord
) -> tuple[list[list[float]], list[str]]:
    points = track(
        session, robot.id, deployment.begun_at, deployment.last_at, TRACK_POINTS_MAX
    ).points
    places = _wgs84(deployment.site, [point.position_ned for point in points])
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
