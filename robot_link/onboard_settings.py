"""Settings that a mission brings on board: controller, prices, and what the map's digest needs.

Every number travels as the small integer of ``robot_link.short_decimal``, so that station and
robot compute with the same floats, and a mission's hash covers them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Self, get_args

from autonomy.configuration import Configuration
from autonomy.control.catalogue import CONTROLLERS
from autonomy.field.config import FieldConfig, KernelParameters, KernelShape
from autonomy.field.model.kernel import gradient_variance
from autonomy.planner.config import EnergyConfig, PlannerConfig
from robot_link.short_decimal import code_of, value_of
from robot_link.short_model import CODE_MAX, codes_of, model_of

_CONTROLLER_KINDS = (
    "controller.backstepping",
    "controller.baseline",
    "controller.pid",
    "controller.integral",
    "controller.governor",
    "controller.swimming",
)
"""By the number that travels; a new kind goes to the end."""
_SHAPES: tuple[KernelShape, ...] = get_args(KernelShape)
_PRICES = tuple(EnergyConfig.model_fields)
_KERNEL_NUMBERS = 5
"""Shape, signal variance, and the three length scales."""
_LEVELS_MAX = 5
_WORST_STD_FACTOR = 1.5
"""Samples beyond the last threshold count as this many times it."""
MOST_INTEGERS = 64
"""More numbers are no settings."""


@dataclass(frozen=True, slots=True)
class DigestSettings:
    """What tells which samples change the map most."""

    kernel: KernelParameters
    """Of the mapped field, in the scale of its model."""
    thresholds_m: tuple[float, ...]
    """Position deviations that part the levels of fidelity, ascending."""
    level_noise_variances: tuple[float, ...]
    """Noise of a sample by its level of fidelity, worst located first."""


@dataclass(frozen=True, slots=True)
class OnboardSettings:
    """Settings as the integers that travel; build it with ``of`` or ``from_integers``.

    What they say was checked then, so the robot's configurations can be read without failing.
    """

    controller: tuple[int, ...]
    """Number of the kind, then its gains in the order of declaration."""
    planner: tuple[int, ...]
    """Energy prices; number of fidelity thresholds and they; shape, variance and length scales of
    the kernel; noise variance by level."""

    @classmethod
    def of(
        cls,
        controller_kind: str,
        controller: Configuration,
        planner: PlannerConfig,
        field: FieldConfig,
    ) -> Self:
        """Round configurations to what travels.

        Args:
            controller_kind: Key of ``autonomy.control.catalogue.CONTROLLERS``.
            controller: Its gains.
            planner: Settings that the plan was made with.
            field: Settings of the robot's map.

        Raises:
            ValueError: If a number does not fit, or the rounded gains are none; it is named.
        """
        if controller_kind not in _CONTROLLER_KINDS:
            raise ValueError(f"controller {controller_kind!r} cannot travel")
        number = _CONTROLLER_KINDS.index(controller_kind)
        gains = _gain_codes(CONTROLLERS[controller_kind].model, controller)
        return cls.from_integers((number, len(gains), *gains, *_planner_codes(planner, field)))

    @property
    def controller_kind(self) -> str:
        """Key of the controller in ``autonomy.control.catalogue.CONTROLLERS``."""
        return _CONTROLLER_KINDS[self.controller[0]]

    def controller_config(self) -> Configuration:
        """Return the gains, of the model that the catalogue names for the kind."""
        return _with_gains(CONTROLLERS[self.controller_kind].model, self.controller[1:])

    def energy_config(self) -> EnergyConfig:
        """Return the prices of the primitives."""
        return EnergyConfig(**dict(zip(_PRICES, map(value_of, self.planner), strict=False)))

    def digest_settings(self) -> DigestSettings:
        """Return what tells which samples change the map most."""
        first = len(_PRICES) + 1
        count = self.planner[first - 1]
        thresholds = tuple(map(value_of, self.planner[first : first + count]))
        shape, *scales = self.planner[first + count : first + count + _KERNEL_NUMBERS]
        variance, north, east, down = map(value_of, scales)
        noises = tuple(map(value_of, self.planner[first + count + _KERNEL_NUMBERS :]))
        kernel = KernelParameters(
            shape=_SHAPES[shape],
            signal_variance=variance,
            length_x_m=north,
            length_y_m=east,
            length_z_m=down,
            noise_variance=noises[-1],
        )
        return DigestSettings(kernel, thresholds, noises)

    def integers(self) -> tuple[int, ...]:
        """Return all numbers, each exact in a float32: kind, number of gains, gains, planner."""
        kind, *gains = self.controller
        return (kind, len(gains), *gains, *self.planner)

    @classmethod
    def from_integers(cls, integers: Sequence[int]) -> Self:
        """Rebuild the settings from ``integers``; zeros behind them do not matter.

        Raises:
            ValueError: If they are none; the sentence says what is wrong.
        """
        if len(integers) > MOST_INTEGERS or any(abs(code) >= CODE_MAX for code in integers):
            raise ValueError("onboard settings are too many numbers, or too large ones")
        try:
            settings = cls(*_parts(tuple(integers)))
            settings.controller_config()
            settings.energy_config()
            thresholds = settings.digest_settings().thresholds_m
        except IndexError as error:
            raise ValueError("onboard settings are cut short") from error
        if any(low >= high for low, high in pairwise((0.0, *thresholds))):
            raise ValueError("fidelity thresholds of onboard settings do not ascend")
        return settings


def _parts(integers: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return what belongs to the controller and to the planner."""
    kind, gains = integers[0], integers[1]
    if not 0 <= kind < len(_CONTROLLER_KINDS):
        raise ValueError(f"controller {kind} of onboard settings is unknown")
    key = _CONTROLLER_KINDS[kind]
    expected = len(CONTROLLERS[key].model.model_fields)
    if gains != expected:
        raise ValueError(f"{key} has {expected} gains, not {gains}")
    begin = 2 + gains
    thresholds = integers[begin + len(_PRICES)]
    if not 0 <= thresholds < _LEVELS_MAX:
        raise ValueError(f"onboard settings have {thresholds} fidelity thresholds")
    end = begin + len(_PRICES) + 1 + thresholds + _KERNEL_NUMBERS + thresholds + 1
    integers[end - 1]  # an IndexError names what is cut short
    shape = integers[begin + len(_PRICES) + 1 + thresholds]
    if not 0 <= shape < len(_SHAPES):
        raise ValueError(f"kernel shape {shape} of onboard settings is unknown")
    if any(integers[end:]):
        raise ValueError("onboard settings are followed by more")
    return (kind, *integers[2:begin]), integers[begin:end]


def _gain_codes(model: type[Configuration], config: Configuration) -> tuple[int, ...]:
    """Return the gains as codes that say valid gains."""
    if type(config) is not model:
        raise ValueError(f"these gains are {type(config).__name__}, not {model.__name__}")
    return codes_of(config, "the gains")


def _code(name: str, value: float) -> int:
    try:
        return code_of(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def _with_gains(model: type[Configuration], codes: Sequence[int]) -> Configuration:
    return model_of(model, codes, "onboard settings")


def _planner_codes(planner: PlannerConfig, field: FieldConfig) -> tuple[int, ...]:
    prices = planner.energy.model_dump()
    planned, mapped = planner.fidelity_thresholds_m, field.fidelity_thresholds_m
    thresholds = planned if len(planned) == len(mapped) else mapped
    kernel = field.single
    named: Mapping[str, float] = MappingProxyType(
        {f"energy.{name}": prices[name] for name in _PRICES}
    )
    codes = [_code(name, value) for name, value in named.items()]
    codes.append(len(thresholds))
    codes += [_code("fidelity threshold", one) for one in thresholds]
    codes.append(_SHAPES.index(kernel.shape))
    scales = (kernel.signal_variance, *kernel.length_scales_m())
    codes += [_code("kernel", one) for one in scales]
    noises = _level_noises(field, thresholds)
    codes += [_code("noise variance", one) for one in noises]
    return tuple(codes)


def _level_noises(field: FieldConfig, thresholds: Sequence[float]) -> tuple[float, ...]:
    """Return the noise variance of a sample by its level, worst located first.

    Where noise depends on the position, a sample at the upper end of a level's deviations stands
    for all of that level: the field's slope times that far, on top of the sensor's noise.
    """
    if field.model in ("recursive", "joint"):
        levels = field.levels if field.model == "recursive" else field.joint_levels
        return tuple(level.noise_variance for level in levels)
    noise = field.single.noise_variance
    if field.model == "single" or not thresholds:
        return (noise,) * (len(thresholds) + 1)
    slope_variance = sum(gradient_variance(field.single)) / 2.0
    worst = _WORST_STD_FACTOR * thresholds[-1]
    return tuple(noise + slope_variance * std**2 for std in (worst, *reversed(thresholds)))
