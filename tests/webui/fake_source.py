"""A scene source whose picture is known: a robot on a helix in the tank, a plan and a map."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from autonomy.channel import CHANNELS
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.site import LAKE, TANK, Area, Site
from autonomy.vehicle.hull import Hull
from robot_link.messages import RobotId, RobotMode
from webui.scene.source import (
    BandView,
    CameraFixView,
    CameraView,
    ComparisonTrack,
    ComparisonView,
    MapView,
    PlanView,
    Pose,
    PredictedView,
    SampleView,
    TargetView,
    TrackPiece,
)

NOON = datetime(2026, 6, 1, 12, tzinfo=UTC)


class FakeSource:
    robot = RobotId("mini-1")
    title = "mini-1"
    hull = Hull()
    fidelity_levels = 3

    def __init__(self, site: Site = TANK) -> None:
        self.site = site
        box = site.domain
        self._low = np.array([box.x_min_m, box.y_min_m, 0.0])
        self._size = np.array(
            [box.x_max_m - box.x_min_m, box.y_max_m - box.y_min_m, box.depth_max_m]
        )
        self.track_ned = self._inside(_helix(400))
        self.std_m = 0.02 + 0.1 * self.track_ned[:, 2] / box.depth_max_m
        self.is_adrift = np.zeros(len(self.track_ned), np.bool_)
        self.restarted = False
        self._plan = self._a_plan()
        self.map = self._a_map()
        self.models = ("recursive", "single")
        self.shown_comparison: ComparisonView | None = None
        self.areas: tuple[Area, ...] = ()
        self.silent: PredictedView | None = None
        self.seen: CameraFixView | None = None
        self.cameras: tuple[CameraView, ...] = ()
        self.followed: TargetView | None = None
        self.followed_path: np.ndarray | None = None
        self.sampled = SampleView(
            self.track_ned[::4],
            np.digitize(-self.std_m[::4], [-0.09, -0.05]).astype(np.int64),
            np.arange(len(self.track_ned[::4])) < 60,
        )

    def _inside(self, share: np.ndarray) -> np.ndarray:
        return self._low + share * self._size

    def pose(self) -> Pose:
        here = self.track_ned[-1]
        return Pose(
            NOON, (here[0], here[1], here[2]), float(self.std_m[-1]), 0.0, -0.5, 0.8, 0.3,
            RobotMode.GLIDING, is_old=False,
        )  # fmt: skip

    def predicted(self) -> PredictedView | None:
        return self.silent

    def camera_fix(self) -> CameraFixView | None:
        return self.seen

    def camera_views(self) -> tuple[CameraView, ...]:
        return self.cameras

    def track_since(self, cursor: int) -> TrackPiece:
        points = self.track_ned[cursor:]
        fidelity = np.digitize(-self.std_m[cursor:], [-0.09, -0.05]).astype(np.int64)
        return TrackPiece(
            len(self.track_ned), self.restarted, points, self.std_m[cursor:], fidelity,
            self.is_adrift[cursor:],
        )  # fmt: skip

    def plan(self) -> PlanView:
        return self._plan

    def maps(self) -> tuple[str, ...]:
        return self.models

    def map_view(self, model: str) -> MapView | None:
        title = {"recursive": "Recursive", "single": "Single"}[model]
        return replace(self.map, model=model, title=title) if model in self.models else None

    def samples(self) -> SampleView | None:
        return self.sampled

    def target(self) -> TargetView | None:
        return self.followed

    def target_path(self) -> np.ndarray | None:
        return self.followed_path

    def keep_outs(self) -> tuple[Area, ...]:
        return self.areas

    def comparison(self) -> ComparisonView | None:
        return self.shown_comparison

    def compare(self, *titles: str) -> None:
        reference = self._inside(_helix(50))
        runs = tuple(
            ComparisonTrack(title, reference + 0.02 * (i + 1)) for i, title in enumerate(titles)
        )
        version = f"whatif-{len(titles)}"
        self.shown_comparison = ComparisonView(version, "Linear glide", reference, runs)

    def rehearse(self) -> None:
        flown = self._plan.points[:, 1:4] + 0.01
        self._plan = replace(self._plan, rehearsed_ned=flown)

    def expect(self) -> None:
        legs = self._plan.points[:, 1:4]
        points = self._plan.points + np.array([0.0, 0.05, 0.05, 0.0, 0.0])
        self._plan = replace(self._plan, points=points, straight_ned=legs)

    def fly_ahead(self, band: BandView) -> None:
        self._plan = replace(self._plan, band=band)

    def set_plan_state(self, state: str) -> None:
        self._plan = replace(self._plan, state=state)

    def _a_plan(self) -> PlanView:
        share = np.array([[0.1, 0.1, 0], [0.4, 0.3, 0.8], [0.7, 0.5, 0], [0.9, 0.9, 0.6],
                          [0.6, 0.9, 0.0], [0.3, 0.8, 0.0]])  # fmt: skip
        corners = self._inside(share)
        kinds = [PrimitiveKind.GLIDE, PrimitiveKind.GLIDE, PrimitiveKind.DIVE,
                 PrimitiveKind.SPIRAL, PrimitiveKind.SWIM]  # fmt: skip
        legs = tuple(
            Leg(kind, tuple(corners[i]), tuple(corners[i + 1]), 0.02, 20.0, 1.5)
            for i, kind in enumerate(kinds)
        )
        at = np.linspace(0.0, 5.0, 51)
        track = [np.interp(at, np.arange(6), corners[:, c]) for c in range(3)]
        std = 0.02 + 0.05 * track[2] / self._size[2] * self._size[0] / 2.75
        points = np.stack([at * 20.0, *track, std], axis=-1)
        return PlanView("plan-14", "draft", legs, points, None)

    def _a_map(self) -> MapView:
        north, east, depth = (
            np.linspace(0, 1, n) * self._size[c] + self._low[c] for c, n in enumerate((20, 12, 8))
        )
        x, y, z = np.meshgrid(*(np.linspace(0, 1, n) for n in (20, 12, 8)), indexing="ij")
        bump = np.exp(-((x - 0.3) ** 2 + (y - 0.4) ** 2) / 0.05 - (z - 0.6) ** 2 / 0.1)
        other = np.exp(-((x - 0.75) ** 2 + (y - 0.7) ** 2) / 0.04 - (z - 0.3) ** 2 / 0.1)
        return MapView(
            CHANNELS[self.site.variable], "recursive", north, east, depth,
            3.4 + 2 * bump + 3 * other, 0.5 - 0.3 * bump, (10, 40, 100), 1, NOON,
        )  # fmt: skip


def _helix(points: int) -> np.ndarray:
    angle = np.linspace(0.0, 5 * np.pi, points)
    return np.stack(
        [
            0.5 + 0.35 * np.cos(angle) * np.linspace(1.0, 0.6, points),
            0.5 + 0.35 * np.sin(angle),
            0.45 - 0.45 * np.cos(2.2 * angle),
        ],
        axis=-1,
    )


def lake_source() -> FakeSource:
    return FakeSource(LAKE)
