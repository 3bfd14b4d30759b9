"""What the 3D scene may draw of one robot, as values behind one small interface.

The station implements ``SceneSource``; the scene polls it at its own rate and never sees a
database, a link or a lock. Every value is an immutable snapshot, so a source may be read from any
thread. Positions are in the site's NED frame, m; the scene converts to its own frame at its edge.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Protocol

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.channel import Channel
from autonomy.planner.plan import Leg, PositionNed
from autonomy.site import Area, Site
from autonomy.vehicle.hull import Hull
from robot_link.messages import RobotId, RobotMode


@dataclass(frozen=True, slots=True)
class Pose:
    """The robot's newest estimate of itself."""

    measured_at: datetime
    position_ned: PositionNed
    position_std_m: float
    """Standard deviation of the horizontal position (larger axis)."""
    roll_rad: float
    pitch_rad: float
    heading_rad: float
    tail_rad: float
    mode: RobotMode
    is_old: bool
    """Whether the estimate is older than its limit, so that it must not look alive."""


@dataclass(frozen=True, slots=True)
class TrackPiece:
    """Track points in the order they were flown, from a cursor on."""

    cursor: int
    """Hand it to the next ``track_since``."""
    restarted: bool
    """Everything drawn before is void (the track was thinned or replaced)."""
    position_ned: FloatArray
    """Shape ``(n, 3)``."""
    position_std_m: FloatArray
    """Shape ``(n,)``."""
    fidelity: IntArray
    """Fidelity level of each point, shape ``(n,)``; the highest is the best located."""
    is_adrift: BoolArray
    """Whether the robot floated at the surface there with nothing to fly, shape ``(n,)``."""


@dataclass(frozen=True, slots=True)
class BandView:
    """Where most of the flights of a plan's dry run were."""

    level: float
    """Part of the flights that it holds, 0..1."""
    leg: IntArray
    """Leg of each station along the track, shape ``(n,)``, ascending."""
    centre_ned: FloatArray
    """Middle of each station, shape ``(n, 3)``, m."""
    half_axes_m: FloatArray
    """Half axes of each station: the longer and the shorter of its horizontal ellipse, and the
    vertical one, shape ``(n, 3)``, m."""
    direction_rad: FloatArray
    """Of the longer axis, from north towards east, shape ``(n,)``."""
    surfacing_ne_m: FloatArray
    """Mean place of each surfacing, shape ``(k, 2)``, m."""
    surfacing_axes_m: FloatArray
    """Half axes of its ellipse, the longer first, shape ``(k, 2)``, m."""
    surfacing_rad: FloatArray
    """Direction of the longer one, shape ``(k,)``."""


@dataclass(frozen=True, slots=True)
class PlanView:
    """The plan that concerns the operator now: running, on board, sent or newest draft."""

    plan_id: str
    state: str
    """As in the REST interface: ``draft``, ``sent``, ``on_board``, ``running``, ``done``."""
    legs: tuple[Leg, ...]
    points: FloatArray
    """Promised trajectory, shape ``(n, 5)``: time of the plan s, north, east, down m, position std
    m. The expected track where the plan was flown ahead often enough, else along the legs."""
    leg_now: int | None
    """Index of the leg being flown, where the robot says so."""
    rehearsed_ned: FloatArray | None = None
    """Where a single rehearsal against the full dynamics went, shape ``(n, 3)``, m."""
    straight_ned: FloatArray | None = None
    """The legs that the robot gets, shape ``(n, 3)``, m, where another track is expected."""
    band: BandView | None = None
    """Where the flights of its dry run were; ``None`` where it was not flown often enough."""


@dataclass(frozen=True, slots=True)
class SampleView:
    """Every sample behind a map, in any order."""

    position_ned: FloatArray
    """Shape ``(n, 3)``, m; the corrected one where a dive was smoothed."""
    fidelity: IntArray
    """Fidelity level of each sample, shape ``(n,)``; the highest is the best located."""
    is_smoothed: BoolArray
    """Whether its position was corrected after the dive, shape ``(n,)``."""


@dataclass(frozen=True, slots=True)
class MapView:
    """One field map on a regular grid."""

    variable: Channel
    model: str
    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    mean: FloatArray
    """Shape ``(nx, ny, nz)``, in the scale of ``variable`` (natural logarithm for ``log``); NaN
    where there is no water."""
    std: FloatArray
    """Standard deviation of ``mean``, same shape and scale."""
    samples_per_level: tuple[int, ...]
    """Samples behind the map by fidelity level, worst level first."""
    version: int
    """Changes whenever the arrays do."""
    updated_at: datetime | None
    title: str = ""
    """What operators call the model; its key where it has no name."""


@dataclass(frozen=True, slots=True)
class ComparisonTrack:
    """Where one controller would take the robot."""

    title: str
    position_ned: FloatArray
    """Shape ``(n, 3)``."""


@dataclass(frozen=True, slots=True)
class ComparisonView:
    """A what-if run: computed, not flown, and drawn so."""

    version: str
    """Changes whenever the tracks do."""
    title: str
    reference_ned: FloatArray
    """What every controller is asked to follow, shape ``(n, 3)``."""
    runs: tuple[ComparisonTrack, ...]


@dataclass(frozen=True, slots=True)
class TargetHypothesis:
    """Where the robot believes its target to be."""

    position_ned: PositionNed
    covariance_m2: tuple[float, float, float]
    """Of the horizontal position: north-north, north-east, east-east."""
    weight: float
    """Probability, 0..1."""


@dataclass(frozen=True, slots=True)
class TargetView:
    """What a robot that follows a target says of its hold on it."""

    measured_at: datetime
    robot_ned: PositionNed
    """Where the robot was then."""
    hypotheses: tuple[TargetHypothesis, ...]
    """The likeliest first."""
    range_m: float | None
    """Range that holds now; None where the robot hears none."""
    true_ned: PositionNed | None
    """Where a virtual target was; None for a real one."""
    is_old: bool
    """Whether it must not look alive: old, or of a robot that lost its target."""
    is_barrier_on: bool = True
    """Whether the robot keeps its target observable; False in a mission for teaching."""


@dataclass(frozen=True, slots=True, eq=False)
class PredictedView:
    """Where a robot that is not heard should be; it has said nothing of this."""

    position_ned: PositionNed
    ellipse_m: tuple[float, float]
    """Half axes of the ellipse that holds it in 90 of 100 cases, the longer one first."""
    ellipse_rad: float
    """Direction of the longer axis, from north towards east."""
    way_ned: FloatArray
    """From where it said to be, shape ``(n, 3)``, m."""
    label: str


@dataclass(frozen=True, slots=True)
class CameraFixView:
    """Where cameras saw the robot last."""

    position_ned: PositionNed
    ellipse_m: tuple[float, float]
    """Half axes of the ellipse that holds it with 90 %, the longer first."""
    ellipse_rad: float
    """Direction of the longer one, from north towards east."""
    label: str


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """What a camera over the water looks at."""

    name: str
    eye_ned: PositionNed
    corners_ned: FloatArray
    """Where the rays of the picture's corners meet the water, shape ``(4, 3)``, m."""


class SceneSource(Protocol):
    """Everything the scene shows of one robot; cheap enough to be polled at 10 Hz."""

    @property
    def robot(self) -> RobotId:
        """Return the robot's id."""
        ...

    @property
    def title(self) -> str:
        """Return the robot's display name."""
        ...

    @property
    def hull(self) -> Hull:
        """Return the robot's outer sizes, those of a usual one where its vehicle is unknown."""
        ...

    @property
    def site(self) -> Site:
        """Return the water that the robot works in."""
        ...

    @property
    def fidelity_levels(self) -> int:
        """Return how many fidelity levels ``TrackPiece.fidelity`` counts."""
        ...

    def pose(self) -> Pose | None:
        """Return the newest pose, ``None`` where the robot never reported one."""
        ...

    def predicted(self) -> PredictedView | None:
        """Return where a robot that is not heard should be, ``None`` while it is.

        The same object as long as nothing about it changed.
        """
        ...

    def camera_fix(self) -> CameraFixView | None:
        """Return where cameras saw the robot last, ``None`` where they never did.

        The same object as long as nothing about it changed.
        """
        ...

    def camera_views(self) -> tuple[CameraView, ...]:
        """Return what each camera looks at; the same object as long as nothing changed."""
        ...

    def track_since(self, cursor: int) -> TrackPiece:
        """Return the track from ``cursor`` on; 0 asks for all of it."""
        ...

    def plan(self) -> PlanView | None:
        """Return the plan to draw; the same object as long as nothing about it changed."""
        ...

    def maps(self) -> tuple[str, ...]:
        """Return the models that ``map_view`` knows, the default first."""
        ...

    def map_view(self, model: str) -> MapView | None:
        """Return the newest map; the same object as long as its version is the same."""
        ...

    def comparison(self) -> ComparisonView | None:
        """Return the what-if run to draw; the same object as long as nothing about it changed."""
        ...

    def samples(self) -> SampleView | None:
        """Return the samples behind the maps; the same object as long as there is none to add."""
        ...

    def target(self) -> TargetView | None:
        """Return the target that the robot follows, None without one or long after."""
        ...

    def target_path(self) -> FloatArray | None:
        """Return where a virtual target of the plan in hand goes, shape ``(n, 3)``.

        The same object as long as nothing about it changed.
        """
        ...

    def keep_outs(self) -> tuple[Area, ...]:
        """Return the polygons that no plan may enter; equal as long as none of them changed."""
        ...
