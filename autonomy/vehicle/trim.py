"""Standing corrections of a robot's actuators, as glider pilots find them from past dives."""

from pydantic import computed_field

from autonomy.configuration import Configuration, quantity
from autonomy.result import Result
from autonomy.vehicle.config import ActuatorLimits

_SHARE_MAX = 0.3
"""Greatest part of an actuator's shorter travel: a robot told a wrong trim still comes up, for it
rises with twice as much buoyancy."""


class TrimConfig(Configuration):
    """What to add to every set point so that the robot does what its model says.

    A robot whose ballast is a few grams off sinks too fast and rises too slowly; one whose
    battery lies a little aft flies nose up. The offsets are added to the commands alone: the
    feedback of pump and sliding mass keeps telling what their sensors measure.
    """

    net_buoyancy_offset_kg: float = quantity(
        0.0, "kg", title="Net buoyancy offset", ge=-0.3, le=0.3, display_unit="g"
    )
    """Added to every net buoyancy set point; positive makes the robot heavier."""
    mass_position_offset_m: float = quantity(
        0.0, "m", title="Mass position offset", ge=-0.05, le=0.05, display_unit="mm"
    )
    """Added to every position of the sliding mass; positive moves it forward, nose down."""

    def stepped(self, offset_kg: float, offset_m: float, share: float) -> "TrimConfig":
        """Return the trim part of the way to another one.

        Raises:
            ValidationError: If that is beyond what a trim can hold.
        """
        now_kg, now_m = self.net_buoyancy_offset_kg, self.mass_position_offset_m
        return TrimConfig(
            net_buoyancy_offset_kg=now_kg + share * (offset_kg - now_kg),
            mass_position_offset_m=now_m + share * (offset_m - now_m),
        )


class GlideError(Result):
    """Root mean square errors of the predicted gliding."""

    depth_rate_m_s: float
    pitch_rad: float


class TrimAdvice(Result):
    """What the dives say of a robot's trim, beside the trim that holds now."""

    dives: int
    """Dives that were used."""
    present: TrimConfig
    full_step: TrimConfig
    """The trim that would have made the robot glide as its model says."""
    half_step: TrimConfig
    """Half-way there from the present trim: what a careful pilot sets first."""
    net_buoyancy_std_kg: float | None
    """Null where the offset is not known, as with the next."""
    mass_position_std_m: float | None
    rmse_now: GlideError | None
    """Null of a trim that comes with an identified vehicle: nothing was flown with it."""
    rmse_proposed: GlideError | None
    is_worth_it: bool
    message: str

    @computed_field
    @property
    def net_buoyancy_offset_kg(self) -> float:
        """That of the full step."""
        return self.full_step.net_buoyancy_offset_kg

    @computed_field
    @property
    def mass_position_offset_m(self) -> float:
        """That of the full step."""
        return self.full_step.mass_position_offset_m


TRIM_PRESETS: dict[str, TrimConfig] = {"miniglider": TrimConfig(), "grace3": TrimConfig()}
"""Trim of a robot that nobody has trimmed yet, by vehicle."""


def trim_flaw(
    net_buoyancy_offset_kg: float, mass_position_offset_m: float, limits: ActuatorLimits
) -> str:
    """Return why a robot must not fly with a trim, or "".

    Args:
        net_buoyancy_offset_kg: As in ``TrimConfig``.
        mass_position_offset_m: As in ``TrimConfig``.
        limits: End stops of the robot's actuators.
    """
    for name, offset, low, high in (
        ("net buoyancy", net_buoyancy_offset_kg, limits.m0_min_kg, limits.m0_max_kg),
        ("mass position", mass_position_offset_m, limits.rp1_min_m, limits.rp1_max_m),
    ):
        if abs(offset) > _SHARE_MAX * min(-low, high):
            return f"the trim of the {name} is beyond {_SHARE_MAX:.0%} of the actuator's travel"
    return ""
