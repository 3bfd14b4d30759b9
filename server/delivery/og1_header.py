"""Scalars and global attributes of a file of OG1.0: who, where, when, by what rules."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

import numpy as np

from autonomy.arrays import FloatArray
from db.column import moment
from robot_link.delivery_config import Sensor
from server.delivery.file_order import FileOrder

COMPACT_TIME: Final = "%Y%m%dT%H%M%S"
SIMULATED: Final = "SIMULATION: this robot does not exist."
_NOTHING: Final = "n/a"
_NO_BYTE: Final = -127
_ROLES: Final = "http://vocab.nerc.ac.uk/collection/W08/current/"


@dataclass(slots=True)
class Extent:
    """What the rows cover."""

    first_fix: tuple[float, float, float] | None = None
    """Time of the first fix, its latitude and longitude."""
    low: FloatArray | None = None
    """Least latitude, longitude and depth."""
    high: FloatArray | None = None
    first_s: float | None = None
    last_s: float | None = None

    def take(self, times_s: FloatArray, places: FloatArray, has_fix: np.ndarray) -> None:
        """Widen it by rows: times, and latitude, longitude and depth."""
        self.first_s = float(times_s[0]) if self.first_s is None else self.first_s
        self.last_s = float(times_s[-1])
        fixes = np.flatnonzero(has_fix & np.isfinite(places[:, 0]))
        if self.first_fix is None and fixes.size:
            row = fixes[0]
            self.first_fix = (float(times_s[row]), float(places[row, 0]), float(places[row, 1]))
        known = places[np.isfinite(places).all(axis=1)]
        if len(known):
            low, high = known.min(axis=0), known.max(axis=0)
            self.low = low if self.low is None else np.minimum(low, self.low)
            self.high = high if self.high is None else np.maximum(high, self.high)


def write_header(file: Any, order: FileOrder, extent: Extent, source_sha256: str) -> None:  # noqa: ANN401 - netCDF4 has no types
    """Write everything that a file says once."""
    _write_scalars(file, order, extent)
    _write_sensors(file, order)
    file.setncatts(
        {
            key: value
            for key, value in (
                *_identity(order).items(),
                *_people(order).items(),
                *_coverage(order, extent).items(),
                *_processing(order, source_sha256).items(),
            )
            if value != ""
        }
    )


def _write_scalars(file: Any, order: FileOrder, extent: Extent) -> None:  # noqa: ANN401 - netCDF4 has no types
    said, deployment = order.metadata, order.wanted.deployment
    texts = {
        "TRAJECTORY": (order.identity, "name of the trajectory", {"cf_role": "trajectory_id"}),
        "PLATFORM_MODEL": (order.robot.model or _NOTHING, "model of the glider", {}),
        "WMO_IDENTIFIER": (said.wmo_identifier or _NOTHING, "WMO identifier", {}),
        "PLATFORM_SERIAL_NUMBER": (order.serial, "serial number of the glider", {}),
        "PLATFORM_NAME": (order.robot.name, "name of the glider", {}),
        "PLATFORM_MAKER": (said.platform_maker or _NOTHING, "maker of the glider", {}),
        "GLIDER_FIRMWARE_VERSION": (
            said.firmware_version or _NOTHING,
            "version of the program on board",
            {},
        ),
        "LANDSTATION_VERSION": (order.software, "version of the program ashore", {}),
        "BATTERY_TYPE": (said.battery_type or _NOTHING, "type of the battery", {}),
        "TELECOM_TYPE": (_telecom(order), "links of the glider", {}),
        "TRACKING_SYSTEM": ("gps" if extent.first_fix else _NOTHING, "tracking system", {}),
    }
    for name, (value, title, more) in texts.items():
        variable = file.createVariable(name, str, ())
        variable[...] = value
        variable.setncatts({"long_name": title, **more})
    site = deployment.site
    latitude, longitude = site.origin_latitude_deg, site.origin_longitude_deg
    comment = "origin of the water's frame: there was no fix"
    if extent.first_fix is not None:
        (_, latitude, longitude), comment = extent.first_fix, "first fix of the deployment"
    numbers = {
        "DEPLOYMENT_TIME": (
            deployment.begun_at.timestamp(),
            {
                "units": "seconds since 1970-01-01T00:00:00Z",
                "calendar": "gregorian",
                "standard_name": "time",
                "long_name": "time of deployment",
            },
        ),
        "DEPLOYMENT_LATITUDE": (
            latitude,
            {
                "units": "degrees_north",
                "standard_name": "latitude",
                "long_name": "latitude of deployment",
                "comment": comment,
            },
        ),
        "DEPLOYMENT_LONGITUDE": (
            longitude,
            {
                "units": "degrees_east",
                "standard_name": "longitude",
                "long_name": "longitude of deployment",
                "comment": comment,
            },
        ),
        "PLATFORM_DEPTH_RATING": (
            site.domain.depth_max_m,
            {"units": "m", "long_name": "deepest place of the water that it may go to"},
        ),
    }
    for name, (value, attributes) in numbers.items():
        variable = file.createVariable(name, "f8", ())
        variable[...] = value
        variable.setncatts(attributes)


def _write_sensors(file: Any, order: FileOrder) -> None:  # noqa: ANN401 - netCDF4 has no types
    """Describe each instrument once, by all that is said of it at any of its channels."""
    instruments: dict[str, list[Sensor]] = {}
    for key, sensor in sorted(order.metadata.sensors.items()):
        if sensor.variable and key in order.channels:
            instruments.setdefault(sensor.variable, []).append(sensor)
    for name, said in instruments.items():
        first = said[0]
        told = {
            "long_name": f"{first.kind.lower().replace('_', ' ')} {first.serial_number}",
            "sensor_type": first.kind,
            "sensor_serial_number": first.serial_number,
            "sensor_maker": _each(one.maker for one in said),
            "sensor_model": _each(one.model for one in said),
            "sensor_calibration_date": _each(one.calibrated_on.replace("-", "") for one in said),
        }
        variable = file.createVariable(name, "i1", (), fill_value=_NO_BYTE)
        variable.setncatts({one: value for one, value in told.items() if value})


def _each(said: Iterable[str]) -> str:
    """Return what is said, each word once; channels of an instrument may differ."""
    return ", ".join(dict.fromkeys(one for one in said if one))


def _telecom(order: FileOrder) -> str:
    kinds = sorted({link.partition(":")[0] for link in order.robot.links})
    return ", ".join(kinds) or _NOTHING


def _identity(order: FileOrder) -> dict[str, Any]:
    said, deployment = order.metadata, order.wanted.deployment
    mark = f"{SIMULATED} " if order.is_simulated else ""
    title = said.title.strip() or "OceanGliders trajectory file"
    summary = said.summary.strip() or deployment.purpose or deployment.title
    return {
        "title": f"SIMULATION - {title}" if order.is_simulated else title,
        "id": order.identity,
        "platform": "sub-surface gliders",
        "platform_vocabulary": "http://vocab.nerc.ac.uk/collection/L06/current/27/",
        "summary": (mark + summary).strip(),
        "comment": " ".join(((mark + (said.comment.strip() or _NOTHING)).strip(), *order.pruned)),
        "internal_mission_identifier": deployment.id,
        "site": deployment.site.name,
        "institution": said.operating_agency,
        "naming_authority": said.naming_authority or _NOTHING,
        "project": said.project or _NOTHING,
        "program": said.program or _NOTHING,
        "keywords": said.keywords,
        "doi": said.doi,
        "acknowledgement": said.acknowledgement,
        "license": said.license,
        "is_simulated": "yes" if order.is_simulated else "no",
        "source": "simulation" if order.is_simulated else "glider observations",
        "featureType": "trajectory",
        "Conventions": "CF-1.10, ACDD-1.3, OG-1.0",
    }


def _people(order: FileOrder) -> dict[str, Any]:
    people, institutions = order.metadata.contributors(), order.metadata.institutions()
    return {
        "contributor_name": ", ".join(person.name for person, _ in people),
        "contributor_email": ", ".join(person.email or _NOTHING for person, _ in people),
        "contributor_role": ", ".join(role for _, role in people),
        "contributor_role_vocabulary": ", ".join(_ROLES for _ in people),
        "contributing_institutions": ", ".join(name for name, _ in institutions),
        "contributing_institutions_role": ", ".join(role for _, role in institutions),
        "contributing_institutions_role_vocabulary": ", ".join(_ROLES for _ in institutions),
    }


def _coverage(order: FileOrder, extent: Extent) -> dict[str, Any]:
    found: dict[str, Any] = {"start_date": order.wanted.deployment.begun_at.strftime(COMPACT_TIME)}
    if extent.first_s is not None and extent.last_s is not None:
        first, last = (
            moment(round(one * 1e6)).strftime(COMPACT_TIME)
            for one in (extent.first_s, extent.last_s)
        )
        found |= {"time_coverage_start": first, "time_coverage_end": last}
    if extent.low is not None and extent.high is not None:
        for number, (what, unit) in enumerate(
            (("lat", "degrees_north"), ("lon", "degrees_east"), ("vertical", "m"))
        ):
            found[f"geospatial_{what}_min"] = np.float64(extent.low[number])
            found[f"geospatial_{what}_max"] = np.float64(extent.high[number])
            found[f"geospatial_{what}_units"] = unit
        found["geospatial_vertical_positive"] = "down"
    return found


def _processing(order: FileOrder, source_sha256: str) -> dict[str, Any]:
    rules, at = order.wanted.rules, order.written_at
    return {
        "rtqc_method": f"IOOS QARTOD, rule set {rules.name} {rules.version}",
        "qc_rule_set": rules.model_dump_json(),
        "source_sha256": source_sha256,
        "data_mode": order.mode,
        "signed_by": order.signed_by,
        "date_created": _compact(at),
        "date_modified": _compact(at),
        "history": order.history,
    }


def _compact(at: datetime) -> str:
    return at.strftime(COMPACT_TIME)
