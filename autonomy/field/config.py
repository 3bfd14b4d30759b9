"""Settings of a field map: model, kernel of each fidelity level, grid; presets per variable."""

import re
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from autonomy.arrays import FloatArray
from autonomy.channel import CHANNELS, KEY_PATTERN, Channel, Scale
from autonomy.configuration import Configuration, quantity
from autonomy.field.scale import to_model

KernelShape = Literal["matern12", "matern32", "matern52", "squared_exponential"]
LARGEST_FACTOR = 10.0
"""Largest factor between levels, either way."""
ScaleFactor = Annotated[float, Field(ge=-LARGEST_FACTOR, le=LARGEST_FACTOR)]
FieldModelKey = Literal["single", "recursive", "joint", "position_noise"]


class KernelParameters(Configuration):
    """Kernel with one length scale per axis, and the noise of the measurements."""

    shape: KernelShape = quantity("matern32", title="Kernel shape", advanced=True)
    """How smooth the field is: a Matern-1/2 field has edges, a squared exponential one none."""
    signal_variance: float = quantity(5.27, title="Signal variance", gt=0.0, le=1e6)
    """Prior variance of the field about its mean, in the model's scale squared."""
    length_x_m: float = quantity(2.41, "m", title="Length scale north", gt=0.0, le=1e6)
    """Distance north over which the field stays alike."""
    length_y_m: float = quantity(2.46, "m", title="Length scale east", gt=0.0, le=1e6)
    """Distance east over which the field stays alike."""
    length_z_m: float = quantity(2.40, "m", title="Length scale in depth", gt=0.0, le=1e6)
    """Distance in depth over which the field stays alike."""
    noise_variance: float = quantity(0.0025, title="Noise variance", gt=0.0, le=1e6)
    """Variance of one measurement about the field, in the model's scale squared."""

    def length_scales_m(self) -> tuple[float, float, float]:
        """Return the length scales north, east, down, m."""
        return (self.length_x_m, self.length_y_m, self.length_z_m)


class GridShape(Configuration):
    """Number of grid points along each axis of a map."""

    x: int = quantity(24, title="Points north", ge=2, le=200)
    """Grid points from the south edge to the north edge."""
    y: int = quantity(14, title="Points east", ge=2, le=200)
    """Grid points from the west edge to the east edge."""
    z: int = quantity(8, title="Points in depth", ge=2, le=100)
    """Grid points from the surface to the deepest level."""


class LearningConfig(Configuration):
    """How kernels are learned from the samples of a map."""

    online: bool = quantity(False, title="Learn between dives")
    """Learn the kernels again in the background after a dive, and keep what was found."""
    starts: int = quantity(3, title="Starts", ge=1, le=20, advanced=True)
    """Places where the search begins; the best end wins."""
    mean: Literal["fixed", "constant", "linear"] = quantity("fixed", title="Prior mean")
    """Keep the prior mean, learn a constant one, or learn one that rises along each axis."""
    learns_rho: bool = quantity(False, title="Learn scale between levels", advanced=True)
    """Learn the factors between levels too, where the joint model is learned; the recursive model
    then has them as well, and should be learned after it."""
    noise_floor_share: float = quantity(1e-3, title="Noise floor", gt=0.0, le=1.0, advanced=True)
    """Smallest noise variance that is believed, as a share of the variance of the values."""
    prior_strength: float = quantity(1.0, title="Prior strength", ge=0.0, le=100.0, advanced=True)
    """How strongly the present kernel holds the learned one back: one over the standard deviation,
    in decades, of a log-normal prior about it; 0 for none."""
    least_new_samples: int = quantity(60, title="New samples", ge=1, le=100_000, advanced=True)
    """Samples that must have come in before the station learns again."""


class FieldConfig(Configuration):
    """How the map of one variable is made."""

    variable: str = quantity("blue_light", title="Channel")
    """The mapped quantity: the key of a channel."""
    model: FieldModelKey = quantity("position_noise", title="Model")
    """The single model takes every position for exact. The recursive one of the thesis and the
    joint auto-regressive one have a Gaussian process per level of position uncertainty. The model
    with position-dependent noise counts how much a sample taken elsewhere than believed differs."""
    scale: Literal["variable", "linear", "log"] = quantity("variable", title="Scale", advanced=True)
    """Whether the model sees values or their logarithms; "variable" is the channel's own."""
    log_floor: float | None = quantity(
        None, title="Least value of the logarithm", gt=0.0, le=1e6, advanced=True
    )
    """Where the model sees logarithms, a value below this is read as this; without one half of the
    last digit that the channel is shown with."""
    prior_mean: float = quantity(0.0, title="Prior mean", ge=-1e6, le=1e6, advanced=True)
    """Value of the field where nothing was measured, at the frame's origin, in its scale."""
    slope_north_per_m: float = quantity(
        0.0, "1/m", title="Prior slope north", ge=-1e6, le=1e6, advanced=True
    )
    """How much the prior mean rises per metre north, in the model's scale."""
    slope_east_per_m: float = quantity(
        0.0, "1/m", title="Prior slope east", ge=-1e6, le=1e6, advanced=True
    )
    """How much the prior mean rises per metre east, in the model's scale."""
    slope_depth_per_m: float = quantity(
        0.0, "1/m", title="Prior slope in depth", ge=-1e6, le=1e6, advanced=True
    )
    """How much the prior mean rises per metre of depth, in the model's scale."""
    memory_s: float = quantity(0.0, "s", title="Memory", ge=0.0, le=1e9, advanced=True)
    """Time after which a sample tells a third (1/e) of what it told; 0 for a field that stays."""
    single: KernelParameters = quantity(KernelParameters(), title="Single model")
    """Kernel of the single model and of the model with position-dependent noise."""
    levels: tuple[KernelParameters, ...] = Field(
        default=(KernelParameters(), KernelParameters(), KernelParameters()),
        title="Fidelity levels",
        min_length=1,
        max_length=5,
    )
    """Kernel of each fidelity level of the recursive model, worst located first; level i models
    what the levels below leave unexplained."""
    joint_levels: tuple[KernelParameters, ...] = Field(
        default=(KernelParameters(), KernelParameters(), KernelParameters()),
        title="Joint levels",
        min_length=1,
        max_length=5,
    )
    """Kernel of each fidelity level of the joint model, worst located first; as many as levels,
    and the same where nothing is said."""
    rho: tuple[ScaleFactor, ...] = Field(
        default=(),
        title="Scale between levels",
        max_length=4,
        json_schema_extra={"unit": "", "advanced": True},
    )
    """Factor by which the field of each level enters the one above, worst located first, in the
    models with levels; one fewer than levels, or none where all are 1."""
    fidelity_thresholds_m: tuple[float, ...] = Field(
        default=(0.05, 0.12),
        title="Fidelity thresholds",
        max_length=4,
        json_schema_extra={"unit": "m"},
    )
    """Position standard deviations that separate the levels, ascending; one fewer than levels."""
    carriage: Literal["still", "water"] = quantity("still", title="The field moves with the water")
    """``water``: samples are carried along by the current map to where their water is now, and the
    doubt of that counts; only the model with position-dependent noise can. It helps where the water
    moves by a good part of a length scale during a survey, and harms in still water."""
    steady_current_m_s: float = quantity(
        0.01, "m/s", title="Unknown current", ge=0.0, le=3.0, advanced=True
    )
    """Standard deviation per axis of a current of which robots may not be told, before any fix has
    shown how far it carries them; the model with position-dependent noise counts it where a robot
    does not, and learns from the jumps at fixes."""
    adapts: bool = quantity(True, title="Adapt to the survey", advanced=True)
    """Whether the model with position-dependent noise multiplies signal variance and length scales
    by what its dives bear out when a map is made anew; the kernel itself stays as it is set."""
    grid: GridShape = quantity(GridShape(), title="Grid")
    """Points at which the map is kept up to date."""
    max_samples: int = quantity(2000, title="Most samples kept", ge=50, le=20_000, advanced=True)
    """When a map holds more samples than this it keeps an evenly spread part of them, so that
    memory (8 bytes x samples x grid points) and time stay bounded."""
    beyond: Literal["thin", "inducing"] = quantity(
        "thin", title="Beyond most samples", advanced=True
    )
    """What a full map does: keep an evenly spread part of its samples, or keep all and sum them up
    at inducing points. Sums do not know which samples shared a position error: where positions are
    uncertain, the model with position-dependent noise then states too small a deviation."""
    inducing_points: int = quantity(512, title="Inducing points", ge=16, le=4096, advanced=True)
    """Points at which a map with more samples than it can hold sums them up."""
    learning: LearningConfig = quantity(LearningConfig(), title="Learning")
    """How kernels are learned from the samples."""
    threshold: float | None = quantity(None, title="Threshold", ge=-1e6, le=1e6)
    """The page Map shows where the variable is above this, in its own unit, and how much of the
    water that is; without a value it asks for one. The map itself is the same."""

    @model_validator(mode="before")
    @classmethod
    def _joint_levels_are_levels(cls, data: Any) -> Any:  # noqa: ANN401 - what a caller hands in
        if not isinstance(data, dict) or "joint_levels" in data or "levels" not in data:
            return data
        return data | {"joint_levels": data["levels"]}

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if not re.fullmatch(KEY_PATTERN, self.variable):
            raise ValueError(f"variable must be the key of a channel; is {self.variable[:50]!r}")
        thresholds = self.fidelity_thresholds_m
        if len(thresholds) != len(self.levels) - 1:
            raise ValueError("fidelity_thresholds_m needs one number fewer than levels")
        if len(self.joint_levels) != len(self.levels):
            raise ValueError("joint_levels needs as many kernels as levels")
        if self.rho and len(self.rho) != len(self.levels) - 1:
            raise ValueError("rho needs one factor fewer than levels, or none")
        if self.model == "position_noise" and self.single.shape == "matern12":
            raise ValueError("single.shape must be smoother than matern12 for position_noise")
        if self.carriage == "water" and self.model != "position_noise":
            raise ValueError(
                "carriage needs the model position_noise: no other counts how unsure it is"
            )
        if any(threshold <= 0 for threshold in thresholds):
            raise ValueError("fidelity_thresholds_m must be positive")
        if any(b <= a for a, b in pairwise(thresholds)):
            raise ValueError("fidelity_thresholds_m must ascend")
        return self

    def for_channel(self, channel: Channel) -> "FieldConfig":
        """Return the same settings with the scale of their channel where they leave it to that."""
        floor = channel.log_floor if self.log_floor is None else self.log_floor
        scale = channel.scale if self.scale == "variable" else self.scale
        return self.model_copy(update={"scale": scale, "log_floor": floor})

    def resolved_scale(self) -> Scale:
        """Return the scale in which the model sees values.

        Raises:
            KeyError: If that is left to a channel of a team's own; see ``for_channel``.
        """
        return CHANNELS[self.variable].scale if self.scale == "variable" else self.scale

    def in_model_scale(self, values: FloatArray) -> FloatArray:
        """Bring measured values of any shape to the scale in which the model sees them.

        Raises:
            KeyError: As ``resolved_scale``.
        """
        floor = CHANNELS[self.variable].log_floor if self.log_floor is None else self.log_floor
        return to_model(self.resolved_scale(), values, floor)

    def prior_mean_at(self, points: FloatArray) -> FloatArray:
        """Return the linear prior mean at NED points ``(n, 3)``, in the model's scale, ``(n,)``."""
        slope = (self.slope_north_per_m, self.slope_east_per_m, self.slope_depth_per_m)
        return self.prior_mean + points @ np.array(slope)

    def with_thresholds(self, fidelity_thresholds_m: tuple[float, ...]) -> "FieldConfig":
        """Return the same settings with the thresholds of one mission.

        Raises:
            pydantic.ValidationError: If the thresholds do not ascend or do not fit the levels.
        """
        return FieldConfig.model_validate(
            self.model_dump() | {"fidelity_thresholds_m": fidelity_thresholds_m}
        )


def _kernel(
    signal_variance: float, length_m: tuple[float, float, float], noise_variance: float
) -> KernelParameters:
    x, y, z = length_m
    return KernelParameters(
        signal_variance=signal_variance,
        length_x_m=x,
        length_y_m=y,
        length_z_m=z,
        noise_variance=noise_variance,
    )


FIELD_PRESETS: dict[str, FieldConfig] = {
    "blue_light": FieldConfig(
        variable="blue_light",
        model="position_noise",
        prior_mean=5.06,
        single=_kernel(4.58, (2.16, 2.28, 2.12), 0.00193),
        levels=(
            _kernel(0.595, (0.575, 0.433, 0.580), 0.0230),
            _kernel(0.130, (0.349, 0.213, 0.201), 0.0231),
            _kernel(0.0350, (0.317, 0.241, 0.201), 0.00340),
        ),
        joint_levels=(
            _kernel(1.56, (1.38, 1.50, 1.31), 0.0680),
            _kernel(0.0984, (1.34, 1.18, 0.541), 0.0455),
            _kernel(0.00327, (0.381, 0.733, 0.381), 0.00306),
        ),
        fidelity_thresholds_m=(0.05, 0.12),
    ),
    "chlorophyll": FieldConfig(
        variable="chlorophyll",
        model="position_noise",
        prior_mean=3.74,
        single=_kernel(17.6, (256.0, 383.0, 9.9), 0.0827),
        levels=(
            _kernel(19.1, (287.0, 397.0, 10.3), 0.0932),
            _kernel(0.0632, (44.5, 47.2, 1.83), 0.0867),
            _kernel(0.335, (81.6, 79.2, 1.81), 0.0792),
        ),
        joint_levels=(
            _kernel(22.9, (286.0, 463.0, 10.7), 0.0841),
            _kernel(0.0429, (50.6, 28.7, 13.0), 0.0707),
            _kernel(0.0321, (51.6, 237.0, 1.52), 0.0754),
        ),
        fidelity_thresholds_m=(2.0, 4.0),
        grid=GridShape(x=24, y=24, z=10),
    ),
}
"""Settings by variable, derived from simulated manual surveys by
``tests.autonomy.manual_survey.derived_preset`` with a generator seeded 0.

The default model is the one whose stated uncertainty agrees best with the truth on twelve other
simulated surveys of 600 samples, of generators seeded 1 to 12. Single, recursive, joint and
position-dependent noise, negative log predictive density and root mean square error: blue light
4.34, 0.54, -0.06, -0.19 at 0.34, 0.47, 0.29, 0.28, because in the tank a drift of 0.1 m is half a
length scale; chlorophyll 1.28, 1.49, 1.35, 1.28 at 1.23, 1.30, 1.29, 1.23, because on the lake it
is a hundredth: there the first and the last agree within their standard error (0.01).
"""
