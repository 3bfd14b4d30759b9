"""Coefficients of Eq. 3.20 from tables."""

import numpy as np
import pytest

from autonomy.identification.polynomial import TERMS, TableError, fit_polynomials
from autonomy.vehicle.config import MINIGLIDER
from autonomy.vehicle.reference.dynamics import flow_rotation, hydrodynamic_wrench

P = MINIGLIDER.parameters


def table(noise: float = 0.0) -> dict[str, np.ndarray]:
    """The Miniglider in a tunnel, one angle varied at a time."""
    sweep = np.radians(np.linspace(-20.0, 20.0, 21))
    zero = np.zeros(21)
    angles = np.concatenate(
        [
            np.column_stack([sweep, zero, zero]),
            np.column_stack([zero, sweep, zero]),
            np.column_stack([zero, zero, sweep]),
        ]
    )
    rows = []
    for alpha, beta, delta in angles:
        to_body = flow_rotation(alpha, beta)
        force, moment = hydrodynamic_wrench(to_body @ [0.3, 0.0, 0.0], np.zeros(3), delta, P)
        drag, side, lift = to_body.T @ force
        rows.append([-drag, side, -lift, *(to_body.T @ moment)])
    values = np.array(rows)
    generator = np.random.default_rng(2)
    values += noise * np.abs(values).max(axis=0) * generator.standard_normal(values.shape)
    columns = dict(zip(TERMS, values.T, strict=True))
    return columns | {
        "speed_m_s": np.full(63, 0.3),
        "alpha_rad": angles[:, 0],
        "beta_rad": angles[:, 1],
        "delta_rad": angles[:, 2],
    }


def fit(columns):
    return fit_polynomials(columns, P.water_density_kg_m3, P.area_m2)


def test_exact_table_gives_the_exact_coefficients():
    found = fit(table()).values
    truth = P.model_dump()
    assert len(found) == 12
    for name, value in found.items():
        assert value == pytest.approx(truth[name], rel=1e-9), name


def test_noise_stays_within_the_standard_errors():
    truth = P.model_dump()
    for coefficient in fit(table(noise=0.01)).coefficients:
        assert coefficient.std > 0.0
        assert abs(coefficient.value - truth[coefficient.name]) < 4.0 * coefficient.std


def test_some_columns_are_enough():
    columns = {k: v for k, v in table().items() if not k.endswith("_n_m") and k != "lift_n"}
    assert set(fit(columns).values) == {
        "drag_0",
        "drag_alpha",
        "drag_delta",
        "side_beta",
        "side_delta",
    }


@pytest.mark.parametrize(
    ("change", "column", "message"),
    [
        ({"alpha_rad": None}, "alpha_rad", "missing"),
        ({"lift_kn": np.zeros(63)}, "lift_kn", "unknown"),
        ({"drag_n": np.zeros(5)}, "drag_n", "5 values"),
        ({"drag_n": np.full(63, np.nan)}, "drag_n", "row 1"),
        ({"speed_m_s": np.zeros(63)}, "speed_m_s", "greater than 0"),
        ({"beta_rad": np.full(63, 20.0)}, "beta_rad", "in degrees"),
        ({"delta_rad": np.zeros(63)}, "drag_n", "vary too little"),
    ],
)
def test_bad_column_is_refused_by_name(change, column, message):
    columns = {k: v for k, v in (table() | change).items() if v is not None}
    with pytest.raises(TableError) as refused:
        fit(columns)
    assert any(name == column and message in said for name, said in refused.value.errors)


def test_all_bad_columns_are_named_at_once():
    columns = table() | {"drag_n": np.full(63, np.inf), "speed_m_s": -np.ones(63)}
    with pytest.raises(TableError) as refused:
        fit(columns)
    assert {name for name, _ in refused.value.errors} == {"drag_n", "speed_m_s"}


def test_table_without_a_force_is_refused():
    angles = {k: v for k, v in table().items() if k not in TERMS}
    with pytest.raises(TableError, match="at least one"):
        fit(angles)
