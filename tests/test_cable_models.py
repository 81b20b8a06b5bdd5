"""The four cable models against the oracle table, mpmath, each other and their own derivatives."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from functools import partial

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from oracle import CABLES

from cdpr_drake.model import cable_models as models
from cdpr_drake.model.kernels import cable_models as kernels

ECM, CMWE, SCMWE, SLSM = range(4)
DIGITS = 50  # of mpmath
STEP = 1e-200  # of complex steps
CABLE_NAMES = pytest.mark.parametrize("name", CABLES)
MODEL_NAMES = pytest.mark.parametrize("model", models.CABLE_MODELS)


def arguments(name: str, *keys: str) -> list[float]:
    """Return inputs of one row of the oracle table."""
    return [CABLES[name][key] for key in keys]


# --- the oracle table, to the ten digits it has


@CABLE_NAMES
@pytest.mark.parametrize(
    ("key", "model", "order"),
    [
        ("l_slsm", "SLSM", 4),
        ("l_scmwe", "SCMWE", 4),
        ("l_cmwe", "CMWE", 4),
        ("l_ecm_2", "ECM", 2),
        ("l_ecm_3", "ECM", 3),
        ("l_ecm_4", "ECM", 4),
        ("l_ecm_exact", "ECM", 12),
    ],
)
def test_lengths_of_the_oracle_table(name: str, key: str, model: str, order: int) -> None:
    length = models.unstrained_length(model, *arguments(name, "Bx", "Bz", "H", "w", "EA"), order)
    assert length == pytest.approx(CABLES[name][key], rel=1e-9)


@CABLE_NAMES
@pytest.mark.parametrize(
    ("key", "model", "order"),
    [
        ("N_scmwe", "SCMWE", 4),
        ("N_cmwe", "CMWE", 4),
        ("N_ecm_2", "ECM", 2),
        ("N_ecm_4", "ECM", 4),
    ],
)
def test_rows_of_the_oracle_table(name: str, key: str, model: str, order: int) -> None:
    row = models.instantaneous_row(model, *arguments(name, "Bx", "Bz", "H", "w", "EA"), order)
    np.testing.assert_allclose(row, CABLES[name][key], rtol=1e-9)


@CABLE_NAMES
def test_chord_rows_of_the_oracle_table(name: str) -> None:
    Bx, Bz, H, w, EA = arguments(name, "Bx", "Bz", "H", "w", "EA")
    T = H * math.hypot(Bx, Bz) / Bx
    row = models.instantaneous_row_chord("ECM", Bx, Bz, T, w, EA)
    np.testing.assert_allclose(row, CABLES[name]["N_ecm_4_chord"], rtol=1e-9)


@CABLE_NAMES
def test_ends_of_the_oracle_table(name: str) -> None:
    Bx, Bz, H, w = arguments(name, "Bx", "Bz", "H", "w")
    ends = models.cable_angles(Bx, Bz, H, w)
    parabola = models.cable_angles(Bx, Bz, H, w, "SCMWE")
    found = {
        "a": kernels.catenary_parameters(Bx, Bz, H, w)[0],
        "tan_alpha": np.tan(ends.alpha),
        "tan_beta": np.tan(ends.beta),
        "beta0": ends.beta0,
        "VA": ends.V_A,
        "VB": ends.V_B,
        "TA": ends.T_A,
        "TB": ends.T_B,
        "VB_parabola": parabola.V_B,
        "z_mid": models.profile(Bx / 2, Bx, Bz, H, w),
        "z_mid_parabola": models.profile(Bx / 2, Bx, Bz, H, w, "SCMWE"),
    }
    assert found == pytest.approx({key: CABLES[name][key] for key in found}, rel=1e-9)
    T = H * math.hypot(Bx, Bz) / Bx
    assert kernels.drawing_point_tension(Bx, Bz, T, w)[0] == pytest.approx(ends.T_A, rel=1e-14)
    assert ends.dbeta == pytest.approx(ends.beta - ends.beta0, abs=1e-14)


# --- mpmath: helper functions


def test_helper_functions_to_all_digits() -> None:
    arguments = [0.0, *np.geomspace(1e-9, 30.0, 400), 0.9999999, 1.0]
    with mp.workdps(DIGITS):
        exact = [mp.mpf(x) for x in arguments[1:]]
        shc = [1.0] + [float(mp.sinh(x) / x) for x in exact]
        coshc = [0.0] + [float(mp.cosh(x) - mp.sinh(x) / x) for x in exact]
        ashc = [1.0] + [float(mp.asinh(x) / x) for x in exact]
        oma = [0.0] + [float(1 - mp.asinh(x) / x) for x in exact]
    for function, expected in ((kernels.shc_coshc, (shc, coshc)), (kernels.ashc_oma, (ashc, oma))):
        found = np.array([function(float(x)) for x in arguments]).T
        np.testing.assert_allclose(found, expected, rtol=2e-15)
        near = np.abs(np.array(arguments)) < 1.0
        np.testing.assert_allclose(found[:, near], np.array(expected)[:, near], rtol=1e-15)


@pytest.mark.parametrize("y", [-3.0, -1.0, 0.0, 1.0, 3.0])
@pytest.mark.parametrize("x", [-2.0, 2.0])
def test_angle_is_atan2(y: float, x: float) -> None:
    assert kernels.angle(y, x) == pytest.approx(math.atan2(y, x), rel=1e-15)
    slope = kernels.angle(complex(y, STEP), complex(x)).imag / STEP
    assert slope == pytest.approx(x / (x * x + y * y), rel=1e-15)


# --- mpmath: the printed formulae, as corrected, with as many digits as they need


def slope_at_A(Bx, Bz, H, w):
    """The asinh of the slope at A, in the paper's logarithmic form."""
    mu = w / H
    root = mp.sqrt((mu * Bz) ** 2 + mp.exp(mu * Bx) + mp.exp(-mu * Bx) - 2)
    return mp.log((mu * Bz + root) / (mp.exp(mu * Bx) - 1))


def length_by_quadrature(model, order, Bx, Bz, H, w, EA):
    """The arc length of the profile, each element shortened by its stretch (eqs. 3, 8)."""
    if model == SCMWE:
        L = mp.hypot(Bx, Bz)
        return mp.quad(lambda x: mp.hypot(1, Bz / Bx - w * L / H * (0.5 - x / Bx)), [0, Bx])
    a, mu = slope_at_A(Bx, Bz, H, w), w / H

    def element(x):
        R = H / EA * mp.cosh(mu * x + a)
        return EA / H * sum((-1) ** (j - 1) * R**j for j in range(1, order + 1))

    return mp.quad(element, mp.linspace(0, Bx, 3))


def printed_length(model, order, Bx, Bz, H, w, EA):
    """Eqs. (6) and (8) as they stand, the number of terms corrected for odd powers."""
    if model == SCMWE:
        r, t = w * mp.hypot(Bx, Bz) / H, Bz / Bx
        k1, k2 = t + r / 2, t - r / 2
        c1, c2 = mp.hypot(1, k1), mp.hypot(1, k2)
        return Bx * (c1 * k1 - c2 * k2 + mp.asinh(k1) - mp.asinh(k2)) / (2 * r)
    a = slope_at_A(Bx, Bz, H, w)
    u = a + w * Bx / H
    length = mp.mpf(0)
    for j in range(1, order + 1):
        inner = mp.binomial(j, j // 2) * Bx / (2 * H) if j % 2 == 0 else mp.mpf(0)
        for n in range(j, 0, -2):
            inner += mp.binomial(j, (j - n) // 2) / (w * n) * (mp.sinh(n * u) - mp.sinh(n * a))
        length += H**j * (-1 / (2 * EA)) ** (j - 1) * inner
    return length


def gradient(function, *point):
    """Derivatives by the first three of several mpmath numbers, as floats.

    By central differences, whose error is far below a float's.
    """
    result = []
    for i in range(3):
        step = mp.mpf(10) ** (-DIGITS // 3) * abs(point[i])
        above, below = ([x + h * (i == k) for k, x in enumerate(point)] for h in (step, -step))
        result.append(float((function(*above) - function(*below)) / (2 * step)))
    return result


def printed_length_T(model, order, Bx, Bz, T, w, EA):
    """As `printed_length`, of the chord tension."""
    return printed_length(model, order, Bx, Bz, T * Bx / mp.hypot(Bx, Bz), w, EA)


def drawing_point_tension(Bx, Bz, T, w):
    H = T * Bx / mp.hypot(Bx, Bz)
    return H * mp.cosh(slope_at_A(Bx, Bz, H, w))


def random_cables(count: int, seed: int, slack: float = 0.5) -> list[tuple[float, ...]]:
    """Cables (Bx, Bz, H, w, EA): slopes within 89.9 degrees, w L / T from 1e-4 to 10^slack."""
    rng = np.random.default_rng(seed)
    cables = []
    for _ in range(count):
        L, angle = math.exp(rng.uniform(0, 5)), math.radians(rng.uniform(-89.9, 89.9))
        w, ratio = 10 ** rng.uniform(-1, 1.5), 10 ** rng.uniform(-4, slack)
        Bx, Bz, T = L * math.cos(angle), L * math.sin(angle), w * L / ratio
        EA = kernels.largest_tension(Bx, Bz, T, w) * 10 ** rng.uniform(0.5, 5)
        cables.append((Bx, Bz, T * math.cos(angle), w, EA))
    return cables


MODELS_AND_ORDERS = [(ECM, 1), (ECM, 2), (ECM, 3), (ECM, 4), (ECM, 7), (SCMWE, 4)]


@pytest.mark.parametrize(("model", "order"), MODELS_AND_ORDERS)
def test_length_is_the_integral_of_the_profile(model: int, order: int) -> None:
    for cable in random_cables(8, seed=10 + order):
        with mp.workdps(25):
            expected = length_by_quadrature(model, order, *map(mp.mpf, cable))
        assert kernels.length_and_row(model, order, *cable)[0] == pytest.approx(
            float(expected), rel=2e-15
        )


@pytest.mark.parametrize(("model", "order"), MODELS_AND_ORDERS)
def test_rows_are_the_gradients_of_the_length(model: int, order: int) -> None:
    for cable in random_cables(8, seed=20 + order):
        with mp.workdps(DIGITS):
            exact = [mp.mpf(x) for x in cable]
            row = gradient(partial(printed_length, model, order), *exact)
            exact[2] *= mp.hypot(*exact[:2]) / exact[0]
            chord_row = gradient(partial(printed_length_T, model, order), *exact)
        found = kernels.length_and_row(model, order, *cable)[1:]
        np.testing.assert_allclose(found, row, rtol=2e-14)
        found = kernels.length_and_row_T(model, order, *map(float, exact))[1:]
        np.testing.assert_allclose(found, chord_row, rtol=2e-14)


def test_drawing_point_tension_ends_and_sag_to_all_digits() -> None:
    deep = (1.0, -6.0, 0.05, 1.0)  # dbeta is 170 degrees
    for cable in (*random_cables(20, seed=30), deep):
        with mp.workdps(DIGITS):
            Bx, Bz, H, w = (mp.mpf(x) for x in cable[:4])
            T = H * mp.hypot(Bx, Bz) / Bx
            row = gradient(drawing_point_tension, Bx, Bz, T, w)
            a, mu, t = slope_at_A(Bx, Bz, H, w), w / H, Bz / Bx
            u = a + mu * Bx
            dbeta = float(mp.atan(mp.sinh(u)) - mp.atan(t))
            forces = [float(H * f(v)) for f in (mp.sinh, mp.cosh) for v in (a, u)]
            x = (mp.asinh(t) - a) / mu
            sag = float(t * x - (mp.cosh(mu * x + a) - mp.cosh(a)) / mu)
        ends = models.cable_angles(*cable[:4])
        # V_A is a difference of two forces of this size, to which its digits refer.
        size = max(ends.T_A, ends.T_B)
        found = [ends.V_A, ends.V_B, ends.T_A, ends.T_B]
        np.testing.assert_allclose(found, forces, rtol=0.0, atol=2e-15 * size)
        assert ends.dbeta == pytest.approx(dbeta, rel=1e-14)
        assert models.sag(*cable[:4]) == pytest.approx(sag, rel=1e-14)
        found = kernels.drawing_point_tension(*cable[:2], float(T), cable[3])
        assert found[0] == pytest.approx(forces[2], rel=1e-14)
        by_force = np.abs(row) + size / np.abs([*cable[:2], float(T)])
        assert np.all(np.abs(np.subtract(found[1:], row)) <= 1e-14 * by_force)


# --- properties


@st.composite
def drawn_cables(draw, least=1e-4, most=3.0, steepest=1.55):
    """Cables (Bx, Bz, H, w): w L / T between bounds, slopes up to near the vertical."""
    L = draw(st.floats(1.0, 150.0))
    angle = draw(st.floats(-steepest, steepest))
    ratio = math.exp(draw(st.floats(math.log(least), math.log(most))))
    w = draw(st.floats(0.1, 30.0))
    return L * math.cos(angle), L * math.sin(angle), w * L / ratio * math.cos(angle), w


def chord_tension(Bx: float, Bz: float, H: float) -> float:
    return H * math.hypot(Bx, Bz) / Bx


@given(drawn_cables(), st.floats(0.01, 100.0))
def test_every_model_is_at_least_the_chord_and_scales(cable: tuple, factor: float) -> None:
    Bx, Bz, H, w = cable
    EA = 1e3 * kernels.largest_tension(Bx, Bz, chord_tension(Bx, Bz, H), w)
    for model in (ECM, CMWE, SCMWE, SLSM):
        length, *N = kernels.length_and_row(model, 4, Bx, Bz, H, w, EA)
        larger = kernels.length_and_row(
            model, 4, factor * Bx, factor * Bz, factor * H, w, factor * EA
        )
        assert larger[0] == pytest.approx(factor * length, rel=1e-13)
        assert larger[1:3] == pytest.approx(N[:2], rel=1e-12)
        if model != ECM:  # of degree 1 in (Bx, Bz, H): Euler's theorem
            assert length >= math.hypot(Bx, Bz) * (1 - 1e-15)
            assert np.dot(N, (Bx, Bz, H)) == pytest.approx(length, rel=1e-13)


@given(drawn_cables(most=1.0))
def test_the_parabola_leaves_the_catenary_with_the_fourth_power(cable: tuple) -> None:
    Bx, Bz, H, w = cable
    L = math.hypot(Bx, Bz)
    ratio = w * L / chord_tension(Bx, Bz, H)
    catenary, parabola = (models.unstrained_length(m, *cable, 1e9) for m in ("CMWE", "SCMWE"))
    assert abs(catenary - parabola) <= (3e-3 * ratio**4 + 1e-15) * L


@given(drawn_cables(), st.floats(1e-12, 1e-6))
def test_every_model_becomes_the_straight_line_without_weight(cable: tuple, faint: float) -> None:
    Bx, Bz, H = cable[:3]
    straight = kernels.length_and_row(SLSM, 4, *cable, 1e9)
    T = chord_tension(Bx, Bz, H)
    for model in (ECM, CMWE, SCMWE):
        for weight in (0.0, faint * T / math.hypot(Bx, Bz)):
            found = kernels.length_and_row(model, 4, Bx, Bz, H, weight, math.inf)
            assert found[:3] == pytest.approx(straight[:3], rel=1e-11, abs=1e-11)
            assert abs(found[3] * H) <= faint**2 * straight[0]
    # With elasticity, weightless: L (1 - R + R^2 - R^3), R = T / EA.
    found = kernels.length_and_row(ECM, 4, Bx, Bz, H, 0.0, 10 * T)[0]
    assert found == pytest.approx(straight[0] * (1 - 0.1 + 0.01 - 0.001), rel=1e-14)


@given(drawn_cables())
def test_elastic_becomes_inelastic_as_the_stiffness_grows(cable: tuple) -> None:
    Bx, Bz, H, w = cable
    tension = kernels.largest_tension(Bx, Bz, chord_tension(Bx, Bz, H), w)
    inelastic = kernels.length_and_row(CMWE, 4, *cable, math.nan)  # does not look at EA
    for stiffness in (1e6, 1e9, 1e12, math.inf):
        elastic = kernels.length_and_row(ECM, 4, *cable, stiffness * tension)
        assert elastic[0] <= inelastic[0]
        assert elastic[0] == pytest.approx(inelastic[0], rel=1.0001 / stiffness + 1e-15)
    assert elastic == pytest.approx(inelastic, rel=1e-14, abs=1e-300)


@given(drawn_cables(), st.floats(0.001, 0.4))
def test_truncated_series_alternate_and_keep_their_bound(cable: tuple, strain: float) -> None:
    Bx, Bz, H, w = cable
    EA = kernels.largest_tension(Bx, Bz, chord_tension(Bx, Bz, H), w) / strain
    lengths = [kernels.length_and_row(ECM, n, *cable, EA)[0] for n in (1, 2, 3, 4, 5, 6, 60)]
    exact = lengths[-1]
    for order, length in enumerate(lengths[:-1], start=1):
        assert abs(length - exact) <= lengths[0] * (strain**order + 1e-14)
        assert (length - exact) * (-1) ** order <= 1e-14 * exact  # too long, too short, ...


@given(drawn_cables(), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_both_forms_of_the_row_give_the_same_rate(cable: tuple, rates: tuple) -> None:
    Bx, Bz, H, w = cable
    L, T = math.hypot(Bx, Bz), chord_tension(Bx, Bz, H)
    EA = 50 * kernels.largest_tension(Bx, Bz, T, w)
    dx, dz, dH = rates[0] * Bx, rates[1] * L, rates[2] * H
    # T = H L / Bx: dT / T = dH / H + Bz (Bz dBx / Bx - dBz) (-1 / L^2)
    dT = T * (dH / H - Bz * (Bz * dx / Bx - dz) / L**2)
    for model in (ECM, CMWE, SCMWE, SLSM):
        length, *N = kernels.length_and_row(model, 4, Bx, Bz, H, w, EA)
        length_T, *M = kernels.length_and_row_T(model, 4, Bx, Bz, T, w, EA)
        assert length_T == pytest.approx(length, rel=1e-14)
        rate, rate_T = np.dot(N, (dx, dz, dH)), np.dot(M, (dx, dz, dT))
        size = np.dot(np.abs(N), (Bx, L, H)) + np.dot(np.abs(M), (Bx, L, 3 * T))
        assert abs(rate - rate_T) <= 1e-14 * size


@given(drawn_cables())
def test_row_and_drawing_point_tension_are_reciprocal(cable: tuple) -> None:
    """The energy stored at given (Bx, Bz, l) has the derivatives H, V_B and -T_A (Maxwell)."""
    _, N1, N2, N3 = kernels.length_and_row(CMWE, 4, *cable, 1e9)
    Bx, Bz, H, w = cable
    L = math.hypot(Bx, Bz)
    _, by_Bx, by_Bz, by_T = kernels.drawing_point_tension(Bx, Bz, H * L / Bx, w)
    by_H = by_T * L / Bx  # and what T = H L / Bx changes by at constant H
    by_Bx, by_Bz = by_Bx - by_T * H * Bz**2 / (L * Bx**2), by_Bz + by_T * H * Bz / (L * Bx)
    assert N1 * by_H - N3 * by_Bx == pytest.approx(1.0, abs=1e-12 * (1 + abs(N1 * by_H)))
    V_x, V_H = (complex_step(partial(kernels.cable_ends, CMWE), cable, i)[5] for i in (0, 2))
    size = abs(V_x) + abs(N2 * by_Bx) + abs(N1 * by_Bz)
    assert abs(V_x - N2 * by_Bx + N1 * by_Bz) <= 1e-12 * size
    size = abs(V_H) + abs(N2 * by_H) + abs(N3 * by_Bz)
    assert abs(V_H - N2 * by_H + N3 * by_Bz) <= 1e-12 * size


@given(drawn_cables())
def test_ends_profile_and_sag_belong_together(cable: tuple) -> None:
    Bx, Bz, H, w = cable
    L = math.hypot(Bx, Bz)
    x = np.linspace(0.0, Bx, 201)
    for model in models.CABLE_MODELS:
        ends = models.cable_angles(*cable, model)
        assert ends.alpha <= ends.beta0 + 1e-15 and ends.beta0 <= ends.beta + 1e-15
        assert ends.dbeta >= 0.0
        length = models.unstrained_length("SLSM" if model == "SCMWE" else model, *cable, math.inf)
        weight = 0.0 if model == "SLSM" else w * length  # of the chord in the SCMWE
        size = max(ends.T_A, ends.T_B)
        assert abs(ends.V_B - ends.V_A - weight) <= 1e-13 * size
        if model in ("ECM", "CMWE"):
            assert abs(ends.T_B - ends.T_A - w * Bz) <= 1e-13 * size
            T = chord_tension(Bx, Bz, H)
            assert kernels.largest_tension(Bx, Bz, T, w) == pytest.approx(size, rel=1e-13)
        z = models.profile(x, *cable, model)
        assert z[0] == 0.0 and abs(z[-1] - Bz) <= 1e-13 * L
        depth, sag = np.max(x / Bx * Bz - z), models.sag(*cable, model)
        # The grid misses the deepest point by at most half a step: by this much of a convex arc.
        assert sag * (1 - 1e-3) - 1e-13 * L <= depth <= sag + 1e-13 * L


@given(drawn_cables(most=0.9))
def test_tension_at_the_drawing_point_gives_back_the_horizontal_tension(cable: tuple) -> None:
    Bx, Bz, H, w = cable
    for model in models.CABLE_MODELS:
        T_A = models.cable_angles(*cable, model).T_A
        found, slack = models.horizontal_tension(model, Bx, Bz, T_A, w)
        assert not slack
        assert found == pytest.approx(H, rel=1e-13)


@given(drawn_cables(most=10.0))
def test_the_taut_branch_is_found_up_to_where_it_ends(cable: tuple) -> None:
    Bx, Bz, H, w = cable
    T = H * math.hypot(Bx, Bz) / Bx
    T_A, _, _, by_T = kernels.drawing_point_tension(Bx, Bz, T, w)
    assume(by_T > 0.01)
    found, slack = kernels.chord_tension_catenary(Bx, Bz, T_A, w)
    assert slack == 0
    assert kernels.horizontal_force_catenary(Bx, Bz, T_A, w)[0] == pytest.approx(found * H / T)
    assert abs(found - T) * by_T <= 1e-14 * (T_A + w * math.hypot(Bx, Bz))


# --- edges


def test_a_vertical_cable_has_a_finite_row() -> None:
    """The ECM weightless: l = L (1 - R + R^2 - R^3); with weight the mean tension is T."""
    T, EA = 300.0, 1e4
    R = T / EA
    row = models.instantaneous_row_chord("ECM", 0.0, [-6.0, 6.0], T, 0.0, EA)
    along = 1 - R + R**2 - R**3
    by_T = 6.0 / EA * (-1 + 2 * R - 3 * R**2)
    np.testing.assert_allclose(row, [[0, -along, by_T], [0, along, by_T]], rtol=1e-14, atol=1e-300)
    for model in models.CABLE_MODELS:
        at = models.instantaneous_row_chord(model, 0.0, -6.0, T, 0.7, EA)
        near = models.instantaneous_row_chord(model, 1e-9, -6.0, T, 0.7, EA)
        np.testing.assert_allclose(at, near, rtol=1e-12, atol=1e-9)


def test_a_folded_parabola_stays_finite() -> None:
    """Past w L = 2 T the parabola over a steep chord turns back; its length goes on smoothly."""
    ratio = np.array([2 - 1e-9, 2, 2 + 1e-9, 5.0])
    T = 0.7 * 6.0 / ratio
    rows = models.instantaneous_row_chord("SCMWE", 0.0, -6.0, T, 0.7, 1e9)
    assert np.all(np.isfinite(rows))
    length = [kernels.length_and_row_T(SCMWE, 4, 0.0, -6.0, t, 0.7, 1e9)[0] for t in T]
    assert length == pytest.approx([6.0, 6.0, 6.0, 3.0 * (2.5 + 2 / 5)], rel=1e-8)
    Bx = np.array([1e-3, 1e-2, 0.1, 1.0])
    H = 0.7 * Bx / 5.0
    N1, N2, N3 = models.instantaneous_row("SCMWE", Bx, -6.0, H, 0.7, 1e9).T
    lengths = models.unstrained_length("SCMWE", Bx, -6.0, H, 0.7, 1e9)
    np.testing.assert_allclose(Bx * N1 - 6.0 * N2 + H * N3, lengths, rtol=1e-13)


def test_a_very_slack_catenary_keeps_its_parameters() -> None:
    """Past the range of sinh the parameters still exist: the cable hangs straight down and up."""
    a, m, h = kernels.catenary_parameters(10.0, -3.0, 5.0 / 800.0, 1.0)
    assert (a, m, h) == pytest.approx((-800.0, 0.0, 800.0), abs=1e-300)
    below, above = (
        kernels.catenary_parameters(10.0, 1e200, 5.0 / h, 1.0)[1] for h in (699.9999, 700.0001)
    )
    assert below == pytest.approx(above, rel=1e-3)


@pytest.mark.parametrize("Bz", [-8.0, -4.0, 0.0, 4.0])
@pytest.mark.parametrize("kernel_model", ["CMWE", "SCMWE"])
def test_too_little_tension_at_the_drawing_point_is_slack(Bz: float, kernel_model: str) -> None:
    Bx, w = 7.0, 0.65727
    T_A = np.linspace(0.0, 3.0 * w * math.hypot(Bx, Bz), 2001)
    H, slack = models.horizontal_tension(kernel_model, Bx, Bz, T_A, w)
    assert slack[0] and not slack[-1]
    changes = np.flatnonzero(np.diff(slack))
    assert len(changes) == 1  # below one tension, not here and there
    np.testing.assert_array_equal(H[slack], pytest.approx(w * Bx / 20, rel=1e-15))
    assert np.all(np.diff(H[~slack]) > 0)
    least = T_A[changes[0] : changes[0] + 2]
    if Bz == 0.0:  # level: h tanh h = 1 for the catenary, w L c / 2 for the parabola
        expected = 0.7544 if kernel_model == "CMWE" else math.hypot(0.5, 0.05)
        assert least[0] / (w * Bx) <= expected <= least[1] / (w * Bx)


def test_a_load_cell_that_reads_below_zero_is_slack() -> None:
    for kernel in (kernels.horizontal_force_catenary, kernels.horizontal_force_parabola):
        for Bz in (-4.0, 4.0):
            assert kernel(7.0, Bz, -500.0, 0.6) == pytest.approx((0.6 * 7.0 / 20, 1))


def test_horizontal_tension_without_weight_is_that_of_the_chord() -> None:
    for model in models.CABLE_MODELS:
        H, slack = models.horizontal_tension(model, 3.0, -4.0, [100.0, 0.0], 0.0)
        np.testing.assert_allclose(H, [60.0, 0.0], rtol=1e-15)
        assert slack.tolist() == [False, True]


# --- real and complex numbers, compiled and not

POINTS = [
    *random_cables(12, seed=40),
    *((*arguments(n, "Bx", "Bz", "H", "w", "EA"),) for n in CABLES),
]


def complex_step(function, point: tuple[float, ...], i: int):
    """Return the derivative of a tuple-valued kernel with respect to its i-th argument."""
    shifted = [complex(x, STEP if k == i else 0.0) for k, x in enumerate(point)]
    return [value.imag / STEP for value in function(*shifted)]


@MODEL_NAMES
def test_complex_step_of_the_length_is_the_row(model: str) -> None:
    m = models.CABLE_MODELS.index(model)
    for cable in POINTS:
        for function in (kernels.length_and_row, kernels.length_and_row_T):
            row = function(m, 4, *cable)[1:]
            slopes = [complex_step(partial(function, m, 4), cable, i)[0] for i in range(3)]
            np.testing.assert_allclose(slopes, row, rtol=1e-12, atol=0.0)


def test_complex_numbers_mix_with_real_ones() -> None:
    Bx, Bz, H, w, EA = POINTS[0]
    mixed = kernels.length_and_row(ECM, 4, Bx, Bz, complex(H, STEP), w, EA)
    length, *row = kernels.length_and_row(ECM, 4, Bx, Bz, H, w, EA)
    assert mixed[0] == pytest.approx(length, rel=1e-15)
    assert mixed[0].imag / STEP == pytest.approx(row[2], rel=1e-12)


def test_complex_steps_of_the_drawing_point_tension() -> None:
    for Bx, Bz, H, w, EA in POINTS:
        point = (Bx, Bz, H * math.hypot(Bx, Bz) / Bx, w)
        T_A, *row = kernels.drawing_point_tension(*point)
        slopes = [complex_step(kernels.drawing_point_tension, point, i)[0] for i in range(3)]
        # A tension along the chord does not change with Bx, but for the weight: a difference.
        size = np.abs(row) + T_A / np.abs(point[:3])
        assert np.all(np.abs(np.subtract(slopes, row)) <= 1e-14 * size)
        # The run of 5 m from drum to eyelet: 5 / (1 + T_A / EA)
        stretched = [-5.0 / EA / (1 + T_A / EA) ** 2 * by for by in row]
        np.testing.assert_allclose(kernels.run_row(5.0, EA, *point), stretched, rtol=1e-14)
        # The inverse function: dT/dT_A = 1 / (dT_A/dT), on the taut branch
        if row[2] > 0.1:
            slope = complex_step(kernels.chord_tension_catenary, (Bx, Bz, T_A, w), 2)[0]
            assert slope == pytest.approx(1 / row[2], rel=1e-11)


def test_complex_steps_of_the_ends() -> None:
    for Bx, Bz, H, w, _ in POINTS[:12]:
        for model in (CMWE, SCMWE):
            alpha, beta, _, dbeta, V_A, V_B = kernels.cable_ends(model, Bx, Bz, H, w)
            steps = complex_step(partial(kernels.cable_ends, model), (Bx, Bz, H, w), 2)
            # tan alpha = V_A / H and tan beta = V_B / H
            for angle, V, i in ((alpha, V_A, 0), (beta, V_B, 1)):
                expected = math.cos(angle) ** 2 * (steps[4 + i] - V / H) / H
                assert steps[i] == pytest.approx(expected, rel=1e-9, abs=1e-13 / H)
            assert steps[3] == pytest.approx(steps[1], rel=1e-9, abs=1e-13 / H)
            assert dbeta == pytest.approx(beta - math.atan2(Bz, Bx), abs=1e-14)


def kernel_values() -> list[float]:
    """Return what every kernel gives at fixed points, real and complex, in one long list."""
    values: list[complex] = []
    for cable in POINTS:
        Bx, Bz, H, w, EA = cable
        T = chord_tension(Bx, Bz, H)
        complex_cable = [complex(x, 1e-3 * x) for x in cable]
        for model in (ECM, CMWE, SCMWE, SLSM):
            values += kernels.length_and_row(model, 4, *cable)
            values += kernels.length_and_row(model, 4, *complex_cable)
            values += kernels.length_and_row_T(model, 4, Bx, Bz, T, w, EA)
            values += kernels.cable_ends(model, Bx, Bz, H, w)
            values.append(kernels.largest_sag(model, Bx, Bz, H, w))
            values.append(kernels.profile_height(model, 0.3 * Bx, Bx, Bz, H, w))
        values += kernels.drawing_point_tension(Bx, Bz, H, w)
        values += kernels.run_row(5.0, EA, Bx, Bz, H, w)
        values += kernels.horizontal_force_catenary(Bx, Bz, 2 * T, w)
        values += kernels.horizontal_force_parabola(Bx, Bz, 2 * T, w)
    return [part for value in values for part in (complex(value).real, complex(value).imag)]


@pytest.mark.needs("numba")
def test_plain_python_gives_the_same_numbers_as_compiled_code() -> None:
    code = "import json, test_cable_models as t; print(json.dumps(t.kernel_values()))"
    here = os.path.dirname(__file__)
    path = os.pathsep.join([here, os.path.dirname(here), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "CDPR_DRAKE_NUMBA": "0", "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    compiled = kernel_values()
    assert len(compiled) > 2000
    np.testing.assert_allclose(json.loads(run.stdout), compiled, rtol=1e-14, atol=1e-300)


# --- arrays and bad input


def test_results_broadcast_over_cables() -> None:
    Bx, w = np.array([7.0, 7.5, 55.0]), 0.65727
    Bz, H = np.array([[-4.0], [2.0]]), 400.0
    for model in models.CABLE_MODELS:
        assert models.unstrained_length(model, Bx, Bz, H, w, 1.3e6).shape == (2, 3)
        rows = models.instantaneous_row(model, Bx, Bz, H, w, 1.3e6)
        assert rows.shape == (2, 3, 3)
        alone = models.instantaneous_row(model, Bx[1], Bz[1, 0], H, w, 1.3e6)
        np.testing.assert_array_equal(rows[1, 1], alone)
        assert models.cable_angles(Bx, Bz, H, w, model).dbeta.shape == (2, 3)
        assert models.horizontal_tension(model, Bx, Bz, H, w)[1].shape == (2, 3)
    assert models.profile(np.linspace(0, 7, 5)[:, None], Bx, -4.0, H, w).shape == (5, 3)
    assert models.instantaneous_row("ECM", [], [], [], w, 1.3e6).shape == (0, 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": "IRVINE"}, '"IRVINE"; known are ECM, CMWE, SCMWE, SLSM'),
        ({"model": "ecm"}, "known are ECM"),
        ({"Bx": [7.0, 0.0]}, r"Bx\[1\] = 0: must be positive"),
        ({"Bx": -1.0}, "Bx = -1: must be positive"),
        ({"Bz": math.nan}, "Bz = nan: must be finite"),
        ({"H": 0.0}, "H = 0: must be positive"),
        ({"H": math.inf}, "H = inf: must be finite"),
        ({"w": -0.1}, "w = -0.1: must not be negative"),
        ({"EA": 0.0}, "EA = 0: must be positive"),
        ({"EA": math.nan}, "EA = nan: must be finite"),
        ({"EA": 462.0}, r"tension \[N\] = 462.022: reaches EA, .* eq. \(6\) diverges"),
        ({"EA": [1e6, 400.0]}, r"tension \[N\]\[1\] = 462.022: reaches EA"),
        ({"order": 0}, "order = 0: must be a whole number, at least 1"),
        ({"order": 2.5}, "order = 2.5: must be a whole number"),
        ({"model": "CMWE", "H": 1e-3}, "H = 0.001: the cable is too slack"),
    ],
)
def test_bad_input_is_refused_by_name(change: dict, message: str) -> None:
    good = {"model": "ECM", "Bx": 7.0, "Bz": -4.0, "H": 400.0, "w": 0.65727, "EA": 1.3e6}
    for function in (models.unstrained_length, models.instantaneous_row):
        with pytest.raises(ValueError, match=message):
            function(**{**good, **change})
    if not {"Bx", "H"} & change.keys():
        del good["H"]
        with pytest.raises(ValueError, match=message):
            models.instantaneous_row_chord(T=400.0 * math.sqrt(65) / 7, **{**good, **change})


def test_bad_input_to_the_other_functions_is_refused() -> None:
    with pytest.raises(ValueError, match="A and B must not coincide"):
        models.instantaneous_row_chord("SCMWE", 0.0, 0.0, 1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="Bx = -1: must not be negative"):
        models.instantaneous_row_chord("SCMWE", -1.0, 0.0, 1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="T = 0: must be positive"):
        models.instantaneous_row_chord("SCMWE", 1.0, 0.0, 0.0, 1.0, 1.0)
    for function in (models.cable_angles, models.sag, partial(models.profile, 3.0)):
        with pytest.raises(ValueError, match="known are ECM"):
            function(7.0, -4.0, 400.0, 0.6, "spring")
        with pytest.raises(ValueError, match=r"H = 0.001: the cable is too slack"):
            function(7.0, -4.0, 1e-3, 0.6)
    with pytest.raises(ValueError, match="T_A = -5: must not be negative"):
        models.horizontal_tension("ECM", 7.0, -4.0, -5.0, 0.6)
