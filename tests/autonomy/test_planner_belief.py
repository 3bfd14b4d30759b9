import numpy as np
import pytest

from autonomy.field.config import FIELD_PRESETS
from autonomy.field.model.kernel import covariance
from autonomy.field.model.model_prior import JointPrior, Places
from autonomy.planner.belief import planning_kernel

FIELD = FIELD_PRESETS["blue_light"]


def of_model(model, **changes):
    return FIELD.model_copy(update={"model": model, **changes})


@pytest.mark.parametrize("model", ["single", "position_noise"])
def test_model_with_one_kernel_is_planned_for_with_it(model):
    assert planning_kernel(of_model(model)) is FIELD.single


@pytest.mark.parametrize("rho", [(), (1.3, 0.8)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_kernel_of_a_joint_model_has_the_variance_and_integral_of_its_field(rho, axis):
    config = of_model("joint", rho=rho)
    one, prior = planning_kernel(config), JointPrior(config.joint_levels, rho)
    assert one.signal_variance == pytest.approx(prior.variance, rel=1e-12)
    points = np.zeros((40_001, 3))
    points[:, axis] = np.linspace(0.0, 40.0, len(points))
    top = Places.of(points, level=2)
    whole = prior.covariance(top[:1], top)[0]
    stands_in = covariance(points[:1], points, one)[0]
    assert np.trapezoid(stands_in, points[:, axis]) == pytest.approx(
        np.trapezoid(whole, points[:, axis]), rel=1e-6
    )
    assert np.abs(stands_in - whole).max() < 0.06 * one.signal_variance


def test_kernel_of_the_recursive_model_is_that_of_its_own_levels():
    one = planning_kernel(of_model("recursive"))
    signals = [level.signal_variance for level in FIELD.levels]
    assert one.signal_variance == pytest.approx(sum(signals))
    assert one.length_x_m == pytest.approx(
        sum(s * level.length_x_m for s, level in zip(signals, FIELD.levels, strict=True))
        / sum(signals)
    )
    assert one.noise_variance == FIELD.levels[-1].noise_variance
