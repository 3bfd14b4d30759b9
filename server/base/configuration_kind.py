"""The tunable models of the station: which there are, and what a robot begins with."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from autonomy.configuration import Configuration
from autonomy.control.catalogue import CONTROLLERS, ControllerKind
from autonomy.current.config import CurrentMapConfig, current_preset
from autonomy.estimation.config import EstimatorConfig, estimator_preset
from autonomy.field.config import FieldConfig
from autonomy.field.preset import field_preset
from autonomy.identification.config import IDENTIFICATION_PRESETS, IdentificationConfig
from autonomy.planner.config import PlannerConfig
from autonomy.planner.preset import planner_preset
from autonomy.quality.rules import GRACE_QARTOD
from autonomy.tag.config import TagConfig
from autonomy.tracking.config import TRACKING_PRESETS, TrackingConfig
from autonomy.vehicle.battery import BATTERY_PRESETS, BatteryConfig
from autonomy.vehicle.config import MINIGLIDER
from autonomy.vehicle.trim import TRIM_PRESETS, TrimConfig
from autonomy.whatif.config import TRIAL_PRESETS, TrialConfig, fitting
from db.query.fleet.robots import RobotRecord
from robot_link.acoustic.config import AcousticConfig
from robot_link.automation_config import AutomationConfig
from robot_link.camera.config import CameraConfig
from robot_link.checklist_config import ChecklistConfig
from robot_link.delivery_config import DeliveryMetadata
from robot_link.lease_config import LeaseConfig
from robot_link.satellite.config import RoutingConfig, SatelliteConfig
from robot_link.standard_config import StandardCommandConfig
from robot_link.storage_config import StorageConfig
from server.base.problem import not_found

ONBOARD_CONTROLLER = "controller.backstepping"
"""The controller that flies the robots; the gains of the others are for what-if runs."""


@dataclass(frozen=True, slots=True)
class Reach:
    """How far a setting gets."""

    key: Literal["station", "mission", "none"]
    words: str
    """For a person who changes it."""


AT_STATION = Reach("station", "Used by the station, from the next plan, map or run on.")
AT_ONCE = Reach("station", "Used by the station at once, for what is on its way too.")
BY_DAILY_PASS = Reach("station", "Used by the station from the next daily pass on.")
WITH_MISSION = Reach("mission", "Reaches the robot with the next plan that is made.")
TRIED_ONLY = Reach(
    "none", "Used in what-if runs only. Not on board: the robot flies its own settings."
)
NOT_ON_BOARD = Reach("none", "Not on board: the robot flies its own settings.")


@dataclass(frozen=True, slots=True)
class ConfigurationKind:
    """One tunable model."""

    key: str
    title: str
    model: type[Configuration]
    default: Configuration
    """The value for all robots while nobody has saved one."""
    preset: Callable[[RobotRecord, str], Configuration]
    """The value for a robot for which nobody has saved one, by the robot and the key of the
    vehicle whose presets it has."""
    reach: Reach = AT_STATION
    simulation_preset: Configuration | None = None
    """Of a controller: its gains for exact states, which a what-if may begin with."""
    is_of_data: bool = False
    """It says how what was measured is judged and told, and moves no robot: nobody needs to be in
    charge of one to change it."""
    is_of_station: bool = False
    """It is of the station as a whole, never of a robot: administrators change it."""


def _by_vehicle(
    key: str,
    title: str,
    presets: Mapping[str, Configuration],
    default: Configuration,
    reach: Reach = AT_STATION,
) -> ConfigurationKind:
    return ConfigurationKind(
        key, title, type(default), default, lambda _, vehicle: presets.get(vehicle, default), reach
    )


def _same_for_all(
    key: str, title: str, default: Configuration, *, is_of_data: bool = False
) -> ConfigurationKind:
    return ConfigurationKind(
        key,
        title,
        type(default),
        default,
        lambda _robot, _vehicle: default,
        AT_ONCE,
        is_of_data=is_of_data,
    )


def _of_controller(kind: ControllerKind) -> ConfigurationKind:
    reach = WITH_MISSION if kind.key == ONBOARD_CONTROLLER else TRIED_ONLY
    like_others = _by_vehicle(
        kind.key, kind.title, kind.presets, kind.preset(MINIGLIDER.key), reach
    )
    return replace(like_others, simulation_preset=kind.simulation_preset)


def _by_variable(robot: RobotRecord, vehicle: str) -> FieldConfig:
    water = estimator_preset(vehicle, robot.site.kind)
    return field_preset(robot.site).model_copy(
        update={"steady_current_m_s": water.steady_current_m_s}
    )


def _planner_by_water(robot: RobotRecord, vehicle: str) -> PlannerConfig:
    preset = planner_preset(vehicle, robot.site.kind)
    return preset.model_copy(update={"domain": robot.site.domain})


def _estimator_by_water(robot: RobotRecord, vehicle: str) -> EstimatorConfig:
    return estimator_preset(vehicle, robot.site.kind)


def _current_by_water(robot: RobotRecord, vehicle: str) -> CurrentMapConfig:
    del vehicle
    return current_preset(robot.site)


def _trial_by_water(robot: RobotRecord, vehicle: str) -> TrialConfig:
    return fitting(TRIAL_PRESETS.get(vehicle, TrialConfig()), robot.site)


KINDS: Mapping[str, ConfigurationKind] = MappingProxyType(
    {
        kind.key: kind
        for kind in (
            ConfigurationKind(
                "planner", "Planner", PlannerConfig, PlannerConfig(), _planner_by_water
            ),
            ConfigurationKind("field", "Field map", FieldConfig, FieldConfig(), _by_variable),
            ConfigurationKind(
                "current_map",
                "Current map",
                CurrentMapConfig,
                CurrentMapConfig(),
                _current_by_water,
                AT_ONCE,
            ),
            ConfigurationKind(
                "estimator",
                "Estimator",
                EstimatorConfig,
                EstimatorConfig(),
                _estimator_by_water,
                NOT_ON_BOARD,
            ),
            _by_vehicle("trim", "Trim", TRIM_PRESETS, TrimConfig(), WITH_MISSION),
            _by_vehicle(
                "tracking", "Target tracking", TRACKING_PRESETS, TrackingConfig(), WITH_MISSION
            ),
            ConfigurationKind(
                "tags",
                "Tags",
                TagConfig,
                TagConfig(),
                lambda _robot, _vehicle: TagConfig(),
                AT_ONCE,
            ),
            _by_vehicle("battery", "Battery", BATTERY_PRESETS, BatteryConfig()),
            ConfigurationKind(
                "trial", "What-if scenario", TrialConfig, TrialConfig(), _trial_by_water
            ),
            _by_vehicle(
                "identification", "Identification", IDENTIFICATION_PRESETS, IdentificationConfig()
            ),
            _same_for_all("satellite", "Satellite", SatelliteConfig()),
            _same_for_all("link", "Links", RoutingConfig()),
            _same_for_all(
                "standard_commands", "Orders to a MAVLink vehicle", StandardCommandConfig()
            ),
            _same_for_all("automation", "Automatic sends", AutomationConfig()),
            _same_for_all("checklist", "Checklists", ChecklistConfig()),
            _same_for_all("delivery", "Metadata of files", DeliveryMetadata(), is_of_data=True),
            _same_for_all("quality", "Quality control", GRACE_QARTOD, is_of_data=True),
            _same_for_all("lease", "Pilot in charge", LeaseConfig()),
            _same_for_all("camera", "Cameras", CameraConfig()),
            _same_for_all("acoustic", "Acoustic modem", AcousticConfig()),
            replace(
                _same_for_all("storage", "Storage", StorageConfig(), is_of_data=True),
                is_of_station=True,
                reach=BY_DAILY_PASS,
            ),
            *map(_of_controller, CONTROLLERS.values()),
        )
    }
)
"""Every tunable model by its key."""


FOREIGN_KINDS = frozenset(
    (
        *("standard_commands", "field", "current_map", "battery", "link", "checklist", "lease"),
        *("quality", "delivery"),
    )
)
"""What can be set of a vehicle of another maker, which takes no plans of ours."""


def fits(kind: str, robot: RobotRecord) -> bool:
    """Tell whether a model means something for a robot."""
    if KINDS[kind].is_of_station:
        return False
    return kind in FOREIGN_KINDS if robot.is_foreign else kind != "standard_commands"


def find_kind(kind: str) -> ConfigurationKind:
    """Return a kind by its key.

    Raises:
        Problem: 404 if there is no such kind; the sentence lists those that there are.
    """
    if kind not in KINDS:
        raise not_found(f"There is no configuration {kind!r}; there are {', '.join(KINDS)}.")
    return KINDS[kind]
