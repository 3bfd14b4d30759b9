"""Files that tests write: a deployment in a database of its own, and what is asked of it."""

import math
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

from autonomy.channel import CHANNELS
from autonomy.quality.rules import GRACE_QARTOD
from db.ingest import Telemetry
from db.query.fleet.deployments import list_deployments
from db.query.fleet.robots import get_robot
from db.store import Store
from robot_link.delivery_config import Contributor, DeliveryMetadata, Sensor
from robot_link.messages import RobotMode
from server.delivery.file_order import FileOrder
from server.delivery.judged import Wanted
from server.delivery.quality import channels_of, derived_of
from tests.db.conftest import START, report, sample

METADATA = DeliveryMetadata(
    principal_investigator=Contributor(name="Ann", email="ann@example.org"),
    operating_agency="A lake station",
    license="CC-BY-4.0",
    title="Lake survey",
    sensors={
        "temperature": Sensor(kind="CTD", serial_number="sn-12", calibrated_on="2026-03-14"),
        "conductivity": Sensor(kind="CTD", serial_number="sn-12"),
        "chlorophyll": Sensor(kind="FLUOROMETER"),
    },
)


def told(
    rows: int, channels: tuple[str, ...], robot: str = "mini-1", period_s: float = 2.0
) -> list[Telemetry]:
    """Return states and samples of a robot that dives and comes up, with a fix at the surface."""
    values: list[Telemetry] = []
    for row in range(rows):
        at = START + timedelta(seconds=period_s * row)
        depth_m = 0.3 * (1.0 - math.cos(2.0 * math.pi * row / 50.0)) / 2.0 + 0.001
        place = (1.0 + 0.001 * (row % 100), 0.5, depth_m)
        if row % 2 == 0:
            mode = RobotMode.GLIDING if row % 50 else RobotMode.SURFACED
            state = report(period_s * row, robot=robot, mode=mode, has_fix=row % 50 == 0)
            values.append(replace(state, position_ned=place))
        for number, key in enumerate(channels):
            if row % (number + 1) == 0:
                channel = CHANNELS[key]
                middle = 10.0 if channel.low < 10.0 < channel.high else channel.high / 2.0
                value = middle + 0.001 * math.sin(row)
                values.append(
                    replace(
                        sample(row * 100 + number, value, robot, variable=key),
                        position_ned=place,
                        measured_at=at,
                    )
                )
    return values


def order_for(store: Store, url: str, folder: Path, robot: str, **more: object) -> FileOrder:
    """Return what is to be written of a robot's first deployment."""
    with store.read() as session:
        (deployment,) = list_deployments(session, robot=robot)
        sampled = channels_of(session, deployment)
        derived = derived_of(sampled)
        keys = [*sampled, *derived]
        record = get_robot(session, robot)
    ranges = {key: (CHANNELS[key].low, CHANNELS[key].high) for key in keys}
    wanted = Wanted(
        url,
        deployment,
        ranges,
        GRACE_QARTOD.with_ranges(ranges),
        smoothed=False,
        derived=tuple(derived),
    )
    order = FileOrder(
        wanted=wanted,
        robot=record,
        channels={key: CHANNELS[key] for key in keys},
        metadata=METADATA,
        thresholds_m=(0.1, 1.0),
        manual=(),
        mode="R",
        signed_by="",
        written_at=START + timedelta(days=1),
        software="grace-ground-station 0",
        folder=folder,
    )
    return replace(order, **more)
