"""Where a resting tag is, from one-way detections of one glider, on surveys drawn at run time.

A glider flies 900 m lines, 300 m apart, at 0.1 m/s; its believed position is off by 8 m (one
standard deviation per axis, drawn anew every half hour). The tag rests within 150 m of the first
two lines, in a water of 2 x 2 km, and transmits every 60 to 180 s. A tag that was heard less than
twice is drawn again. ``TAG_DRAWS`` tells how many tags.
"""

import io
import os
import tempfile
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from autonomy.site import LAKE
from autonomy.tag.config import TagConfig
from autonomy.tag.resting import Extent, RestingPlace, heard_share, resting_place
from benchmarks.field.field import at_least, at_most
from db.engine import write_engine
from db.migrate import migrate
from db.query.fleet.robots import add_robot
from server.tag.importing import DetectionsOrder, keep
from server.tag.vue import VueRow, header, read_vue, written
from tests.db.conftest import robot_record

AREA = "tags"
DRAWS = int(os.environ.get("TAG_DRAWS", "40"))
WIDTH_M = 2000.0
LINE_M, APART_M, SPEED_M_S = 900.0, 300.0, 0.1
POSITION_STD_M = 8.0
FIX_EVERY_S, MINUTE_S = 1800.0, 60.0
TRUTH = TagConfig()
CERTAIN = TRUTH.model_copy(update={"range_doubt": 0.0, "delay_doubt": 0.0})


@dataclass(frozen=True)
class Survey:
    """What one glider heard of one tag."""

    tag_ne_m: FloatArray
    detected_ne_m: FloatArray
    track_ne_m: FloatArray

    def place(self, told: TagConfig) -> RestingPlace:
        seconds = np.full(len(self.track_ne_m), MINUTE_S)
        water = Extent(0.0, WIDTH_M, 0.0, WIDTH_M)
        return resting_place(self.detected_ne_m, self.track_ne_m, seconds, told, water)


def survey(rng: np.random.Generator, hours: float, truth: TagConfig = TRUTH) -> Survey:
    """Draw a tag that is heard at least twice, and fly."""
    while True:
        start = rng.uniform(200.0, WIDTH_M - 200.0 - LINE_M, 2)
        tag = start + rng.uniform((0.0, -150.0), (LINE_M, APART_M + 150.0))
        duration_s = hours * 3600.0
        gaps = rng.uniform(0.5, 1.5, int(3.0 * duration_s / truth.delay_s)) * truth.delay_s
        sent_s = np.cumsum(gaps)[np.cumsum(gaps) < duration_s]
        fixes_s = np.arange(0.0, duration_s + 2.0 * FIX_EVERY_S, FIX_EVERY_S)
        errors = rng.normal(0.0, POSITION_STD_M, (2, len(fixes_s)))

        def believed(at_s: FloatArray) -> FloatArray:
            off = [np.interp(at_s, fixes_s, axis) for axis in errors]  # noqa: B023 - called here
            return start + flown(at_s) + np.column_stack(off)  # noqa: B023

        distance = np.hypot(*(start + flown(sent_s) - tag).T)
        is_heard = rng.random(len(sent_s)) < heard_share(distance, truth)
        if is_heard.sum() >= 2:
            minutes_s = np.arange(0.0, duration_s, MINUTE_S)
            return Survey(tag, believed(sent_s[is_heard]), believed(minutes_s))


def flown(at_s: FloatArray) -> FloatArray:
    """Return where the glider is from its start, shape ``(n, 2)``, m."""
    line, along = np.divmod(at_s * SPEED_M_S, LINE_M + APART_M)
    north = np.minimum(along, LINE_M)
    north = np.where(line % 2 == 0, north, LINE_M - north)
    return np.column_stack([north, line * APART_M + np.maximum(along - LINE_M, 0.0)])


@dataclass(frozen=True)
class Found:
    """How well tags were found."""

    median_m: float
    holds_50: float
    holds_90: float


def found(surveys: list[Survey], told: TagConfig) -> Found:
    """Hold resting places against the tags."""
    errors, in_50, in_90 = [], [], []
    for one in surveys:
        place = one.place(told)
        errors.append(float(np.hypot(*(np.array(place.mean_ne_m) - one.tag_ne_m))))
        cell = tuple(np.minimum(one.tag_ne_m // (WIDTH_M / 100.0), 99).astype(int))
        in_50.append(bool(place.region(0.5)[cell]))
        in_90.append(bool(place.region(0.9)[cell]))
    return Found(float(np.median(errors)), float(np.mean(in_50)), float(np.mean(in_90)))


def measure() -> list[dict[str, object]]:
    """Draw surveys of three lengths; those of 6 h are also judged by wrong tellings."""
    seeds = np.random.SeedSequence()
    print(f"tags: {DRAWS} tags, seed {seeds.entropy}", flush=True)
    rows = []
    surveys: list[Survey] = []
    for hours, child in zip((3, 12, 6), seeds.spawn(3), strict=True):
        rng = np.random.default_rng(child)
        surveys = [survey(rng, hours) for _ in range(DRAWS)]
        for name, told in (("known", CERTAIN), ("doubted", TRUTH)):
            rows += _rows(f"{hours} h, range and delay {name}", found(surveys, told), hours == 6)
    for name, change in (
        ("range told 0.7 of the true one", {"half_range_m": 210.0, "width_m": 42.0}),
        ("range told 1.4 of the true one", {"half_range_m": 420.0, "width_m": 84.0}),
        ("delay told half the true one", {"delay_s": 60.0}),
        ("delay told twice the true one", {"delay_s": 240.0}),
    ):
        for doubt, told in (("taken for certain", CERTAIN), ("doubted", TRUTH)):
            wrong = found(surveys, told.model_copy(update=change))
            rows += _rows(f"6 h, {name}, {doubt}", wrong, has_bar=False)
    began_s = time.process_time()
    surveys[0].place(TRUTH)
    spent_ms = 1e3 * (time.process_time() - began_s)
    return [
        *rows,
        at_most(AREA, "resting place after 6 h, processor", spent_ms, "ms", 1000.0),
        at_most(AREA, "100,000 detections imported, processor", _import_s(), "s", 5.0),
    ]


def _import_s() -> float:
    """Return the processor time of an import of 100,000 detections into a new database, s."""
    began = datetime(2026, 7, 1, tzinfo=UTC)
    row = VueRow(0, began, "VR2W-1", "A69-1601-1", None, None, None, None, None, (48.5, -123.2))
    text = "".join(
        written(replace(row, measured_at=began + timedelta(seconds=7 * n))) for n in range(100_000)
    )
    data = (header() + text).encode()
    site = LAKE.model_copy(update={"origin_latitude_deg": 48.5, "origin_longitude_deg": -123.2})
    with tempfile.TemporaryDirectory() as folder:
        engine = write_engine(f"sqlite:///{folder}/bench.sqlite3")
        migrate(engine)
        with Session(engine) as session:
            robot = replace(robot_record("tagged", 2), site=site)
            add_robot(session, robot)
            order = DetectionsOrder(io.BytesIO(data), len(data), "vue.csv", robot.id, "bench")
            spent_s = time.process_time()
            found = read_vue(order.file, order.size, lambda _: None)
            keep(session, order, found, began, lambda _share, _text: None)
            session.commit()
            spent_s = time.process_time() - spent_s
        engine.dispose()
    return spent_s


def _rows(what: str, result: Found, has_bar: bool) -> list[dict[str, object]]:
    return [
        at_most(AREA, f"{what}: median error", result.median_m, "m", 50.0 if has_bar else None),
        at_least(AREA, f"{what}: 90 % region holds", result.holds_90, 0.85 if has_bar else None),
        at_least(AREA, f"{what}: 50 % region holds", result.holds_50, None),
    ]
