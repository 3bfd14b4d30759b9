"""Two months of a fleet's past, laid out in a database without flying them.

Schema, robots, deployments, plans, events and alarms are made by the product's own code. Rows of
which there are millions are made by the database itself, in the order in which it keeps them, with
the runs and sums that the writer would have made of them.

``python -m benchmarks.station.past FOLDER [--rows N]`` fills the SQLite file of a data folder.
"""

import argparse
import hashlib
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from sqlalchemy import Engine, create_engine, text
from sqlalchemy.orm import Session

from autonomy.estimation.energy_use import EnergyUse
from autonomy.planner.config import PlannerConfig
from autonomy.planner.work import powers_of_uses
from autonomy.site import LAKE
from autonomy.vehicle.config import GRACE3
from db.column import microseconds
from db.engine import is_sqlite
from db.query.fleet.deployment_change import add_deployment
from db.query.fleet.robots import RobotRecord, add_robot
from db.query.mission.plans import add_plan, change_plan
from db.query.station.alarms import AlarmRecord, save_alarm
from db.query.station.events import add_event
from db.query.station.settings import put_setting
from db.sample_ingest import channel_keys
from db.sample_tables import COARSE_S, FINE_S
from db.state_sums import sum_up_next
from db.store import Store
from robot_link.messages import RobotId, SystemId
from robot_link.mission import MissionSettings
from server.base.settings import Settings

ROBOTS, SPAN = 20, timedelta(days=60)
STAYS = 5
"""So often a robot that comes and goes was in the water; the first never left it."""
FIELDS = ("chlorophyll", "temperature", "dissolved_oxygen")
CONDITIONS = ("internal_pressure", "battery_current")
DIVE_S, PLAN_DIVES = 600, 40
_SETTINGS = MissionSettings(
    sample_period_s=1.0, max_uncertainty_m=10.0, timeout_s=86_400.0, start_x_m=0.0, start_y_m=0.0
)
_PLANNED = {"settings": asdict(_SETTINGS)}
_LONG_SHARE = 0.42
"""Of all rows, those of the robot that never left the water, at most."""
_STEP, _STRETCHES = 250_000, 500
"""Rows that one transaction makes, and stretches of them that one sums up."""


@dataclass(frozen=True, slots=True)
class Stay:
    """A stretch of time that a robot spent in the water."""

    robot: int
    """Its key; its id is ``grace-<key>``."""
    log: int
    begins_at: datetime
    seconds: int
    is_over: bool

    @property
    def name(self) -> str:
        return f"grace-{self.robot}"

    @property
    def ends_at(self) -> datetime:
        return self.begins_at + timedelta(seconds=self.seconds)


def lay_out(url: str, rows: int, ends_at: datetime) -> list[Stay]:
    """Fill a database that has nothing yet.

    Args:
        url: SQLAlchemy URL.
        rows: About how many rows of what robots said.
        ends_at: Moment of the newest of them.

    Returns:
        Which robot was in the water when.
    """
    past = stays(rows, ends_at)
    with closing(Store.open(url)) as store:
        store.change(lambda session: _add_fleet(session, past, ends_at)).result()
        for stay in past:
            store.change(lambda session, stay=stay: _add_missions(session, stay)).result()
    engine = create_engine(url)
    try:
        _fill(engine, past)
    finally:
        engine.dispose()
    with closing(Store.open(url)) as store:
        while store.change(lambda session: sum_up_next(session, _STRETCHES, ends_at)).result():
            pass
    return past


def stays(rows: int, ends_at: datetime) -> list[Stay]:
    """Return which robot was in the water when, so that there are about so many rows.

    Raises:
        ValueError: If there would have to be more than the fleet can make in the time.
    """
    per_second = sum(made.rows / made.every_s for made in MADE)
    seconds, span_s = rows / per_second, int(SPAN.total_seconds())
    long_s = min(span_s, int(seconds * _LONG_SHARE))
    each_s = int((seconds - long_s) / (ROBOTS - 1) / STAYS)
    if each_s > 0.9 * span_s / STAYS:
        raise ValueError(f"{rows} rows are more than {ROBOTS} robots make in {SPAN.days} days")
    found = [Stay(1, 1, ends_at - timedelta(seconds=long_s), long_s, is_over=False)]
    for robot in range(2, ROBOTS + 1):
        for number in range(STAYS):
            end = ends_at - SPAN * ((STAYS - 1 - number) / STAYS) - timedelta(minutes=robot)
            begin = end - timedelta(seconds=each_s)
            found.append(Stay(robot, 1 + number, begin, each_s, is_over=number < STAYS - 1))
    return found


def _add_fleet(session: Session, past: list[Stay], ends_at: datetime) -> None:
    for number in range(1, ROBOTS + 1):
        add_robot(
            session,
            RobotRecord(
                id=RobotId(f"grace-{number}"),
                name=f"grace-{number}",
                model=GRACE3.key,
                kind="real",
                system_id=SystemId(number),
                links=(),
                site=LAKE,
                created_at=ends_at - SPAN - timedelta(days=1),
            ),
            is_deployed=False,
        )
    channel_keys(session, (*FIELDS, *CONDITIONS))
    for stay in past:
        looked_us = microseconds(stay.ends_at)
        put_setting(session, f"current looked at: {stay.name}", {"us": looked_us})
        put_setting(session, f"battery use: {stay.name}", _learned(looked_us))
        title, end = f"{stay.name}, stay {stay.log}", stay.ends_at if stay.is_over else None
        add_deployment(session, stay.name, title=title, started_at=stay.begins_at, ended_at=end)


def _learned(looked_us: int) -> dict[str, object]:
    """Return what a station has learned of a battery that looked at all that was said."""
    use = EnergyUse.of_model(powers_of_uses(GRACE3, PlannerConfig().primitives)).document()
    return {"vehicle": GRACE3.key, "use": use, "looked_us": looked_us, "hours": {}}


def _add_missions(session: Session, stay: Stay) -> None:
    """Add plans, alarms and events of a stay."""
    for dive in range(stay.seconds // DIVE_S):
        at = stay.begins_at + timedelta(seconds=dive * DIVE_S)
        if dive % 2 == 0:
            add_event(session, at, "robot.surfaced", f"{stay.name} surfaced.", robot=stay.name)
        if dive % PLAN_DIVES:
            continue
        plan = add_plan(session, stay.name, "survey", config={}, at=at, by="past")
        for state in ("draft", "sent", "on_board", "running", "done"):
            change_plan(session, plan, at=at, state=state, sha256=_sha256(stay), document=_PLANNED)
        add_event(session, at, "plan.on_board", f"{plan} is on board.", robot=stay.name)
        save_alarm(
            session,
            AlarmRecord(
                id=plan.replace("plan", "alarm"),
                cause="battery",
                robot=stay.name,
                level="warning",
                text="The battery is low.",
                state="closed",
                raised_at=at,
                acknowledged_at=at,
                acknowledged_by="past",
                cleared_at=at + timedelta(minutes=5),
            ),
        )


def _sha256(stay: Stay) -> str:
    return hashlib.sha256(f"{stay.name} {stay.log}".encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Made:
    """A table of which a robot in the water makes rows every so many seconds.

    ``columns`` are SQL that both engines understand, about ``n``, whole seconds in the water,
    ``phase``, those of the dive, and ``part``, which of the rows; words in braces are filled in.
    """

    table: str
    every_s: int
    columns: dict[str, str]
    rows: int = 1


_AT = "{begin} + n * 1000000"
_DEPTH_M = "CASE WHEN phase < 30 THEN 0.1 WHEN phase < 315 THEN phase * 0.05 - 1.4"
_DEPTH_M += " ELSE 30.1 - phase * 0.05 END"
_NOISE = "(((n + {robot}) * 7919) % 10007) / 10007.0"
_NORTH_M, _EAST_M = "250.0 + 180.0 * sin(n / 9000.0 + {robot})", "250.0 + 180.0 * cos(n / 9000.0)"
_HEARD = {"robot_key": "{robot}", "measured_at": _AT, "received_at": f"{_AT} + 80000"}
_STATE = _HEARD | {
    "north_m": _NORTH_M,
    "east_m": _EAST_M,
    "depth_m": _DEPTH_M,
    "position_std_m": "0.5 + phase * 0.01",
    "has_fix": "CASE WHEN phase < 30 THEN {true} ELSE {false} END",
    "is_by_cameras": "{false}",
    "mode": "CASE WHEN phase < 30 THEN 6 ELSE 2 END",
    "velocity_north_m_s": "0.3 * cos(n / 9000.0)",
    "velocity_east_m_s": "-0.3 * sin(n / 9000.0)",
    "velocity_down_m_s": f"0.05 * {_NOISE}",
    "roll_rad": f"0.02 * {_NOISE}",
    "pitch_rad": "CASE WHEN phase < 30 THEN 0.0 WHEN phase < 315 THEN -0.4 ELSE 0.4 END",
    "heading_rad": "sin(n / 9000.0) * 3.1",
    "net_buoyancy_kg": f"0.01 + 0.001 * {_NOISE}",
    "mass_position_m": f"0.002 + 0.0001 * {_NOISE}",
    "tail_rad": f"0.1 * {_NOISE}",
    "battery_fraction": "1.0 - 0.8 * n / {seconds}",
    "battery_v": f"12.4 - 1.6 * n / {{seconds}} - 0.05 * {_NOISE}",
    "energy_used": "n * 0.002",
}
_PLAN = _HEARD | {
    "sha256": "'{sha256}'",
    "state": "2",
    "leg": "(n / 300) % 40",
    "legs": "40",
    "energy_used": "n * 0.002",
    "reason": "''",
}
_ACTUATOR = _HEARD | {
    **{f"{which}_rate_share": f"0.9 + 0.1 * {_NOISE}" for which in ("mass", "pump")},
    **{f"{which}_rate_std_octaves": "0.05" for which in ("mass", "pump")},
    **{f"{which}_delay_s": "0.4" for which in ("mass", "pump")},
    **{f"{which}_delay_std_s": "0.05" for which in ("mass", "pump")},
    "speed_share": "1.0",
    "is_mass_off": "{false}",
    "is_swinging": "{false}",
    "stuck": "''",
}
_FRAME = {
    "robot_key": "{robot}",
    "at": _AT,
    "carrier": "'xbee'",
    "outgoing": "{false}",
    "data": "{bytes}",
}
_READ = {"robot_key": "{robot}", "channel_key": "", "measured_at": _AT, "value": _NOISE}
_TAKEN = _READ | {
    "log_key": "{log}",
    "sequence": "",
    "value": f"14.0 - 0.2 * ({_DEPTH_M}) + 0.5 * {_NOISE}",
    "north_mm": f"CAST(1000 * ({_NORTH_M}) AS integer)",
    "east_mm": f"CAST(1000 * ({_EAST_M}) AS integer)",
    "depth_mm": f"CAST(1000 * ({_DEPTH_M}) AS integer)",
    "position_std_um": "500000 + phase * 10000",
}
_SMOOTHED = {name: _TAKEN[name] for name in ("log_key", "sequence", "north_mm", "east_mm")}
_SMOOTHED |= {"depth_mm": _TAKEN["depth_mm"], "position_std_um": "400000"}
_SMOOTHED["sequence"] = "n * 3 + part"
MADE = (
    Made("state_report", 1, _STATE),
    Made("raw_frame", 2, _FRAME),
    Made("plan_report", 10, _PLAN),
    Made("actuator_report", 10, _ACTUATOR),
    *(
        Made("sample", 1, _TAKEN | {"channel_key": f"{key + 1}", "sequence": f"n * 3 + {key}"})
        for key in range(len(FIELDS))
    ),
    Made("smoothed_place", 1, _SMOOTHED, len(FIELDS)),
    *(
        Made("reading", 10, _READ | {"channel_key": str(len(FIELDS) + key)})
        for key in range(1, len(CONDITIONS) + 1)
    ),
)
_SQLITE = {"true": "1", "false": "0", "bytes": "randomblob(48)"}
_POSTGRESQL = {
    "true": "true",
    "false": "false",
    "bytes": "decode(md5(n::text) || md5((n + 1)::text) || md5((n + 2)::text), 'hex')",
}
_RECURSION = """
WITH RECURSIVE one(m) AS (SELECT {low} UNION ALL SELECT m + 1 FROM one WHERE m < {high}),
second AS (SELECT m / {rows} * {every_s} AS n, m / {rows} * {every_s} % {dive_s} AS phase,
           m % {rows} AS part FROM one)"""
_SERIES = """
WITH second AS (SELECT m / {rows} * {every_s} AS n, m / {rows} * {every_s} % {dive_s} AS phase,
                       m % {rows} AS part
                FROM generate_series(CAST({low} AS bigint), {high}) AS of_series(m))"""
_OF_EACH = {
    "sqlite": (
        "SELECT low.robot_key, low.channel_key, {length_s}, low.stretch, size, least, least_at,"
        " greatest, greatest_at FROM (SELECT robot_key, channel_key, {place} AS stretch,"
        " sum({one}) AS size, min({low}) AS least, {low_at} AS least_at FROM {source}"
        " GROUP BY stretch) AS low JOIN (SELECT {place} AS stretch, max({high}) AS greatest,"
        " {high_at} AS greatest_at FROM {source} GROUP BY stretch) AS high"
        " ON low.stretch = high.stretch"
    ),
    "postgresql": (
        "SELECT robot_key, channel_key, {length_s}, {place}, sum({one}), min({low}),"
        " (array_agg({low_at} ORDER BY {low}))[1], max({high}),"
        " (array_agg({high_at} ORDER BY {high} DESC))[1]"
        " FROM {source} GROUP BY robot_key, channel_key, {place}"
    ),
}
"""SQLite takes what stands beside an extreme from the row that is it."""


def _fill(engine: Engine, past: list[Stay]) -> None:
    """Make the rows; keys are not checked, for the statements keep them by themselves."""
    for statement in _statements(past, engine.dialect.name):
        with engine.connect() as connection:
            if is_sqlite(engine):
                connection.exec_driver_sql("PRAGMA synchronous=OFF")
            else:
                connection.exec_driver_sql("SET session_replication_role = replica")
            connection.execute(text(statement))
            connection.commit()
    if not is_sqlite(engine):
        with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            connection.exec_driver_sql("VACUUM ANALYZE")  # as its own daemon would have done


def _statements(past: list[Stay], dialect: str) -> Iterator[str]:
    words = _SQLITE if dialect == "sqlite" else _POSTGRESQL
    source = _RECURSION if dialect == "sqlite" else _SERIES
    for log, stay in enumerate(past, start=1):
        heard, last = microseconds(stay.ends_at), len(FIELDS) * stay.seconds - 1
        yield f"INSERT INTO sample_log VALUES ({log}, {stay.robot}, {stay.log}, {heard}, NULL)"
        yield f"INSERT INTO sample_run VALUES ({log}, 0, {last})"
        told = {
            "begin": str(microseconds(stay.begins_at)),
            "robot": str(stay.robot),
            "log": str(log),
            "seconds": str(float(stay.seconds)),
            "sha256": _sha256(stay),
        }
        for made in MADE:
            columns = [one.format(**told, **words) for one in made.columns.values()]
            chosen = f"({', '.join(made.columns)})", f"SELECT {', '.join(columns)} FROM second"
            count = stay.seconds // made.every_s * made.rows
            shape = {"every_s": made.every_s, "rows": made.rows, "dive_s": DIVE_S}
            for low in range(0, count, _STEP):
                high = min(low + _STEP, count) - 1
                second = source.format(low=low, high=high, **shape)
                yield f"INSERT INTO {made.table} {chosen[0]} {second} {chosen[1]}"
    for robot in range(1, ROBOTS + 1):
        for made in MADE:
            if "channel_key" in made.columns:
                yield from _sums(made.table, robot, made.columns["channel_key"], dialect)


def _sums(table: str, robot: int, channel: str, dialect: str) -> Iterator[str]:
    """Return the statements that sum up a channel of a robot."""
    of_channel = f"robot_key = {robot} AND channel_key = {channel}"
    fine = {
        "length_s": FINE_S,
        "place": f"measured_at / {FINE_S * 1_000_000}",
        "one": "1",
        "source": f"(SELECT * FROM {table} WHERE {of_channel}) AS kept",
        **dict.fromkeys(("low", "high"), "value"),
        **dict.fromkeys(("low_at", "high_at"), "measured_at"),
    }
    coarse = {
        "length_s": COARSE_S,
        "place": f"place / {COARSE_S // FINE_S}",
        "one": "size",
        "source": f"(SELECT stretch AS place, robot_key, channel_key, size, least, least_at,"
        f" greatest, greatest_at FROM {table}_rollup WHERE {of_channel}"
        f" AND length_s = {FINE_S}) AS fine",
        "low": "least",
        "high": "greatest",
        "low_at": "least_at",
        "high_at": "greatest_at",
    }
    for words in (fine, coarse):
        yield f"INSERT INTO {table}_rollup {_OF_EACH[dialect].format(**words)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rows", type=int, default=1_000_000)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    url = Settings(data_dir=arguments.folder).resolved_database_url
    lay_out(url, arguments.rows, datetime.now(UTC) - timedelta(minutes=1))


if __name__ == "__main__":
    main()
