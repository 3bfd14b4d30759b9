"""The robot's parameters: gains, manners and satellite settings that the station may change."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from autonomy.control.config import BacksteppingConfig
from autonomy.control.controller import BacksteppingController
from autonomy.vehicle.config import Vehicle
from onboard.flight.executive import Executive
from onboard.profile import FlightProfile
from onboard.satellite.policy import CallLimits
from onboard.satellite.talk import TalkSettings
from robot_link.service.parameter_table import Parameter, ParameterTable, ParameterType

_GAINS = {
    "CTL_K_Z": "k_z",
    "CTL_K_1": "k_1",
    "CTL_K_PSI": "k_psi",
    "CTL_K_2": "k_2",
    "CTL_K_XI": "k_xi",
    "CTL_K_3": "k_3",
    "CTL_PITCH_TRADE": "pitch_trade_rad",
}
_GAIN_MIN, _GAIN_MAX = 1e-3, 100.0
_PITCH_TRADE_MAX = 1.5


@dataclass(frozen=True, slots=True)
class _Manner:
    """A number of the flight profile that may be changed."""

    field: str
    minimum: float
    maximum: float
    text: str


_MANNERS = {
    "SURF_MIN_S": _Manner("surface_min_s", 1.0, 600.0, "Shortest stay between two dives, s"),
    "SURF_MAX_S": _Manner("surface_max_s", 1.0, 3600.0, "Longest wait for the station, s"),
    "FLOOR_MARGIN_M": _Manner("floor_margin_m", 0.05, 20.0, "Comes up nearer to the floor, m"),
    "SHORE_MARGIN_M": _Manner("shore_margin_m", 0.05, 50.0, "Comes up nearer to the shore, m"),
}
FIX_DEPTH = "FIX_DEPTH_M"
_FIX_DEPTH_MIN_M, _FIX_DEPTH_MAX_M = 0.01, 2.0
_SILENCE, _PERIOD, _BYTES = "SAT_SILENCE_S", "SAT_PERIOD_S", "SAT_BYTES"
_DAY, _HEALTH = "SAT_DAY_MAX", "SAT_HEALTH_S"


class OwnParameters:
    """Declares the parameters of one robot and applies each change at once.

    Gains hold for missions that bring none.

    Args:
        vehicle: The robot.
        controller: Its gains as built.
        profile: Its manners as built.
        executive: What flies it.
        talk: Its satellite settings; None without a satellite modem.
        fix_depth_m: Deeper than this it takes no fix, as built.
        believe_fixes_to: Told how deep that is from now on.
        kept: Values from before it was switched off; what does not fit any more is left out.
        save: Called with all values after a change.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        controller: BacksteppingConfig,
        profile: FlightProfile,
        executive: Executive,
        talk: TalkSettings | None,
        *,
        fix_depth_m: float,
        believe_fixes_to: Callable[[float], None],
        kept: Mapping[str, float],
        save: Callable[[dict[str, float]], None],
    ) -> None:
        self._vehicle = vehicle
        self._controller = controller
        self._profile = profile
        self._executive = executive
        self._talk = talk
        self._fix_depth_m = fix_depth_m
        self._believe_fixes_to = believe_fixes_to
        self._save = save
        declared = [*_gain_parameters(controller), *_manner_parameters(profile)]
        declared.append(_fix_depth(fix_depth_m))
        if talk is not None:
            declared += _satellite_parameters(talk)
        self.table = ParameterTable(declared, values=kept, on_change=self._take)
        """What the link serves."""
        self._apply()

    def _take(self, _name: str, _value: float) -> None:
        self._apply()
        self._save({value.name: value.value for value in self.table.all()})

    def _apply(self) -> None:
        values = {value.name: value.value for value in self.table.all()}
        gains = {
            field: values[name]
            for name, field in _GAINS.items()
            if not math.isclose(values[name], getattr(self._controller, field), rel_tol=1e-6)
        }
        config = self._controller.model_copy(update=gains)
        self._executive.set_controller(BacksteppingController(self._vehicle, config))
        manners = {manner.field: values[name] for name, manner in _MANNERS.items()}
        self._executive.set_profile(replace(self._profile, **manners))
        depth_m = values[FIX_DEPTH]
        is_built = math.isclose(depth_m, self._fix_depth_m, rel_tol=1e-6)
        self._believe_fixes_to(self._fix_depth_m if is_built else depth_m)
        if self._talk is not None:
            self._talk.limits = CallLimits(values[_SILENCE], values[_PERIOD], int(values[_DAY]))
            self._talk.record_bytes = int(values[_BYTES])
            self._talk.health_s = values[_HEALTH]


def _gain_parameters(controller: BacksteppingConfig) -> list[Parameter]:
    fields = BacksteppingConfig.model_fields
    return [
        Parameter(
            name,
            ParameterType.REAL32,
            getattr(controller, field),
            0.0 if field == "pitch_trade_rad" else _GAIN_MIN,
            _PITCH_TRADE_MAX if field == "pitch_trade_rad" else _GAIN_MAX,
            fields[field].title or field,
        )
        for name, field in _GAINS.items()
    ]


def _manner_parameters(profile: FlightProfile) -> list[Parameter]:
    return [
        Parameter(
            name,
            ParameterType.REAL32,
            getattr(profile, manner.field),
            manner.minimum,
            manner.maximum,
            manner.text,
        )
        for name, manner in _MANNERS.items()
    ]


def _fix_depth(built_m: float) -> Parameter:
    return Parameter(
        FIX_DEPTH,
        ParameterType.REAL32,
        built_m,
        _FIX_DEPTH_MIN_M,
        _FIX_DEPTH_MAX_M,
        "Takes no fix deeper than this, m",
    )


def _satellite_parameters(talk: TalkSettings) -> list[Parameter]:
    limits = talk.limits
    real, whole = ParameterType.REAL32, ParameterType.INT32
    return [
        Parameter(
            _SILENCE, real, limits.radio_silence_s, 1.0, 86400.0, "Calls after radio silence of, s"
        ),
        Parameter(
            _PERIOD, real, limits.session_period_s, 40.0, 86400.0, "Time between two calls, s"
        ),
        Parameter(_BYTES, whole, talk.record_bytes, 70, 340, "Most bytes of one record"),
        Parameter(
            _HEALTH,
            real,
            talk.health_s,
            0.0,
            86400.0,
            "Time between two records of its condition, s; 0: neither that nor channels",
        ),
        Parameter(_DAY, whole, limits.sessions_per_day, 24, 20_000, "Most sessions of a day"),
    ]
