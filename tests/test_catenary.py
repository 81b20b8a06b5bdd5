"""The elastic catenary against tabulated, high-precision and independently computed values."""

from __future__ import annotations

import math
import os
import pickle
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import mpmath
import numpy as np
import pytest
from cable_classes import CLASSES, random_cables
from oracle import CABLES, IRVINE_CABLES

from cdpr_drake.errors import CableError
from cdpr_drake.model import catenary as public
from cdpr_drake.model.catenary import (
    cable_energy,
    cable_shape,
    elastic_catenary,
)
from cdpr_drake.model.kernels import catenary, is_compiled
from cdpr_drake.model.robot import AxialStiffness

SAMPLE = 2000 if is_compiled() else 150  # cables of each class and kind

# Drum run [m]; softening as a part of asymptote times offset; offset [N].
KINDS = {
    "plain": (0.0, 0.0, 1.0),
    "run": (5.4, 0.0, 1.0),
    "softening": (0.0, 0.95, 3.0),
    "run and softening": (5.4, 0.8, 300.0),
    "long run and softening": (50.0, 0.9, 1e4),
}
OUTPUTS = {
    "force": slice(0, 3),
    "T_A": slice(3, 4),
    "T_B": slice(4, 5),
    "t_A": slice(5, 8),
    "t_B": slice(8, 11),
    "dbeta": slice(11, 12),
    "H": slice(12, 13),
    "l0": slice(13, 14),
}
PLACE, RATE = [0, 1, 2, 6], [3, 4, 5, 7]  # columns of a Jacobian: p_B and length; their rates
EPS = np.finfo(float).eps


def law_of(EA: float, kind: str) -> tuple[np.ndarray, float]:
    """Return the stiffness law, EA at high tension, and the drum run of one of `KINDS`."""
    run, softening, offset = KINDS[kind]
    return np.array([EA, softening * EA * offset, offset]), run


def secant(law: np.ndarray, T: float) -> float:
    """Return EA(T)."""
    return law[0] - law[1] / (T + law[2])


def central(f: Callable, x: np.ndarray, step: np.ndarray):
    """Return the four-point central difference of f at x over a step."""
    return (8 * (f(x + step) - f(x - step)) - f(x + 2 * step) + f(x - 2 * step)) / 12


def textbook_residual(Bx, Bz, H, V_B, l0, w, EA) -> np.ndarray:
    """Return by how much [m] the span's equations, as the textbook has them, miss (Bx, Bz).

    In extended precision, for they lose the digits that the kernel keeps.
    """
    Bx, Bz, H, V_B, l0, w, EA = (np.longdouble(a) for a in (Bx, Bz, H, V_B, l0, w, EA))
    V_A = V_B - w * l0
    x = H * l0 / EA + H / w * (np.arcsinh(V_B / H) - np.arcsinh(V_A / H))
    z = (V_A * l0 + w * l0 * l0 / 2) / EA + (np.hypot(H, V_B) - np.hypot(H, V_A)) / w
    return np.array([x - Bx, z - Bz], float)


class OneCable:
    """The kernels for one cable from the origin, x = [p_WB, v_WB, length, length_rate]."""

    def __init__(self, w: float, law: np.ndarray, run: float, damping_time: float = 0.0) -> None:
        self.w, self.law, self.run, self.damping_time = float(w), law, float(run), damping_time

    def _arguments(self, x: np.ndarray) -> tuple:
        p, v, length, rate = (np.array(x[i], float) for i in np.split(np.arange(8), [3, 6, 7]))
        return (
            np.zeros((1, 3)), p[None], v[None], length, rate, self.w, self.law,
            np.array([self.run]), self.damping_time,
        )  # fmt: skip

    def __call__(self, x: np.ndarray) -> np.ndarray:
        out = np.zeros((1, 14))
        assert catenary.cable_forces(*self._arguments(x), out) == 0, x
        return out[0]

    def jacobian(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        out, jacobian = np.zeros((1, 14)), np.full((1, 14, 8), np.nan)
        assert catenary.cable_forces_jacobian(*self._arguments(x), out, jacobian) == 0, x
        return out[0], jacobian[0]


def some_cables(
    count: int, seed: int, sag: str, tilt: tuple[float, float] | None = None
) -> Iterator[tuple[OneCable, np.ndarray]]:
    """Yield cables of a class of sag, in all directions or tilted little from the vertical.

    Their kinds change from one to the next, and so do speeds, some of which reach the limit of the
    damping.
    """
    generator = np.random.default_rng(seed)
    for i in range(count):
        L = np.exp(generator.uniform(0, np.log(60)))
        u = generator.normal(size=3)
        if tilt:
            lean, angle = 10 ** generator.uniform(*tilt), generator.uniform(0, 2 * np.pi)
            u = np.array([lean * np.cos(angle), lean * np.sin(angle), generator.choice([-1, 1])])
        p = L * u / np.linalg.norm(u)
        law, run = law_of(10 ** generator.uniform(5, 6.5), list(KINDS)[i % len(KINDS)])
        strain = generator.uniform(1e-4, 5e-3) if sag == "taut" else 0.0
        slack = {
            "taut": 1.0,
            "slack": generator.uniform(1.001, 1.3),
            "between": 1 + generator.uniform(-1e-3, 1e-3),
        }[sag]
        length = (L * slack + run) / (1 + strain)
        rate = generator.normal() * generator.choice([0.1, 30.0])
        x = np.array([*p, *generator.normal(size=3), length, rate])
        yield OneCable(10 ** generator.uniform(-0.7, 1), law, run, 1e-3), x


# --- tabulated values


@pytest.mark.parametrize("name", IRVINE_CABLES)
def test_plain_span_has_the_tabulated_forces_and_stiffness(name: str) -> None:
    row = IRVINE_CABLES[name]
    Bx, Bz, l0, w, EA = (row[key] for key in ("Bx", "Bz", "l0", "w", "EA"))
    H, V_B, _, status = catenary.solve_catenary(Bx, Bz, l0, w, EA)
    assert status == 0
    found = [H, V_B, np.hypot(H, V_B - w * l0), np.hypot(H, V_B)]
    np.testing.assert_allclose(found, [row[key] for key in ("H", "VB", "TA", "TB")], rtol=1e-9)
    x, z, _, Kxx, Kxz, Kzx, Kzz, gx, gz, *_ = catenary._linearise(
        H, V_B, l0, l0, 0.0, w, EA, 0.0, 1.0
    )
    np.testing.assert_allclose([x, z], [Bx, Bz], rtol=1e-13)
    np.testing.assert_allclose([Kxx, Kxz, Kzz], row["K"], rtol=1e-9)
    assert Kxz == Kzx
    slopes = -(Kxx * gx + Kxz * gz), -(Kzx * gx + Kzz * gz)
    np.testing.assert_allclose(slopes, row["dF_dl0"], rtol=1e-9)


@pytest.mark.parametrize("name", [n for n in IRVINE_CABLES if IRVINE_CABLES[n]["Bx"] > 1e-3])
def test_public_state_has_the_tabulated_forces_and_stiffness(name: str) -> None:
    row = IRVINE_CABLES[name]
    Bx, H, T_A, T_B = row["Bx"], row["H"], row["TA"], row["TB"]
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    p = turn @ [Bx, 0.0, row["Bz"]]
    state = elastic_catenary([p, p], row["l0"], row["w"], row["EA"])
    for i in range(2):
        force = turn.T @ state.force_on_platform[i]
        np.testing.assert_allclose(force, [-H, 0, -row["VB"]], rtol=1e-9, atol=1e-12 * T_A)
        Kxx, Kxz, Kzz = row["K"]
        K = [[Kxx, 0, Kxz], [0, H / Bx, 0], [Kxz, 0, Kzz]]
        found = -turn.T @ state.position_stiffness[i] @ turn
        np.testing.assert_allclose(found, K, rtol=1e-9, atol=1e-12 * Kxx)
        slope = -turn.T @ state.length_stiffness[i]
        x, z = row["dF_dl0"]
        np.testing.assert_allclose(slope, [x, 0, z], rtol=1e-9, atol=1e-12 * abs(x))
        np.testing.assert_allclose(state.tension_at_drawing_point[i], T_A, rtol=1e-9)
        np.testing.assert_allclose(state.tension_at_attachment_point[i], T_B, rtol=1e-9)
        np.testing.assert_allclose(state.horizontal_tension[i], H, rtol=1e-9)
        assert state.unstrained_span_length[i] == row["l0"]


@pytest.mark.parametrize("name", CABLES)
def test_span_of_given_horizontal_tension_has_the_tabulated_length(name: str) -> None:
    row = CABLES[name]
    inputs = Bx, Bz, H, w, EA = [row[key] for key in ("Bx", "Bz", "H", "w", "EA")]
    V_B, l0, status = catenary.irvine_from_horizontal(*inputs)
    assert status == 0
    np.testing.assert_allclose([V_B, l0], [row["VB_irvine"], row["l0_irvine"]], rtol=1e-9)
    found = catenary.irvine_row(*inputs)
    assert found[:2] == (V_B, l0)
    np.testing.assert_allclose(found[5:8], row["N_irvine"], rtol=1e-9)
    back = catenary.solve_catenary(Bx, Bz, l0, w, EA)
    np.testing.assert_allclose(back[:2], (H, V_B), rtol=1e-8)


@pytest.mark.parametrize("softening", [0.0, 0.7])
@pytest.mark.parametrize("name", CABLES)
def test_row_of_given_horizontal_tension_is_the_derivative(name: str, softening: float) -> None:
    row = CABLES[name]
    at, w = np.array([row["Bx"], row["Bz"], row["H"]]), row["w"]
    law = np.array([row["EA"], softening * row["EA"] * 200.0, 200.0])

    def span(x: np.ndarray) -> np.ndarray:
        return np.array(catenary.irvine_row_softening(*x, w, *law)[:2])

    V_B, l0, *slopes, status = catenary.irvine_row_softening(*at, w, *law)
    assert status == 0
    EA = secant(law, np.hypot(at[2], V_B - w * l0))
    residual = textbook_residual(*at, V_B, l0, w, EA)
    assert np.abs(residual).max() <= 1e-13 * np.hypot(*at[:2])
    found = np.array(slopes).reshape(2, 3)
    for j, step in enumerate(np.diag(3e-4 * at)):
        np.testing.assert_allclose(found[:, j], central(span, at, step) / step[j], rtol=2e-8)


@pytest.mark.parametrize("Bx, H", [(0.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (np.nan, 1.0), (1.0, 1e-4)])
def test_impossible_horizontal_tension_gives_a_status(Bx: float, H: float) -> None:
    assert catenary.irvine_from_horizontal(Bx, -1.0, H, 1.0, 1e6)[2] == 1


# --- all classes of cables, with and without run and softening


def check_solution(row: np.ndarray, length: float, law: np.ndarray, run: float, found: tuple):
    """Check H, V_B, l0 against the equations; return the residuals over L and over Bx."""
    Bx, Bz, _, w, _ = row
    H, V_B, l0, _, failed, *_ = found
    assert not failed and H > 0, row
    T_A = np.hypot(H, V_B - w * l0)
    EA = secant(law, T_A)
    assert abs(length - l0 - run / (1 + T_A / EA)) <= 1e-13 * length, row
    rx, rz = np.abs(textbook_residual(Bx, Bz, H, V_B, l0, w, EA))
    assert rx <= 1e-8 * Bx, row
    return max(rx, rz) / np.hypot(Bx, Bz)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CLASSES)
def test_every_cable_of_a_class_is_solved(name: str, kind: str) -> None:
    generator = np.random.default_rng(1)
    worst = 0.0
    for row in random_cables(name, SAMPLE, generator):
        (Bx, Bz, l0, w, EA), (law, run) = row, law_of(row[4], kind)
        length = l0 + run / (1 + generator.uniform(0, 0.003))
        L = math.sqrt(Bx * Bx + Bz * Bz)  # as the kernel rounds it
        found = catenary._solve(Bx, Bz, L, length, run, w, *law, catenary.AFRESH)
        worst = max(worst, check_solution(row, length, law, run, found))
        if kind == "plain":
            assert catenary.solve_catenary(Bx, Bz, l0, w, EA) == (found[0], found[1], found[3], 0)
    assert worst <= 1e-12


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", CLASSES)
def test_the_last_resort_solves_them_too(name: str, kind: str) -> None:
    generator = np.random.default_rng(2)
    for row in random_cables(name, 20, generator):
        (Bx, Bz, l0, w, _), (law, run) = row, law_of(row[4], kind)
        length = l0 + run / (1 + generator.uniform(0, 0.003))
        found = catenary._bracket(Bx, Bz, np.hypot(Bx, Bz), length, run, w, *law)
        assert check_solution(row, length, law, run, found) <= 1e-11


def test_the_last_resort_is_reached_where_newton_cycles() -> None:
    # Nearly vertical, between slack and taut, and twenty times softer when slack.
    row = np.array(
        [
            2.133757014448438e-05,
            58.665781701804846,
            58.66513132032226,
            1.2642978775682583,
            4882046.5830237055,
        ]
    )
    (Bx, Bz, l0, w, _), (law, run) = row, law_of(row[4], "softening")
    found = catenary._solve(Bx, Bz, np.hypot(Bx, Bz), l0, run, w, *law, catenary.AFRESH)
    assert found[3] > catenary.MAX_ITERATIONS
    assert check_solution(row, l0, law, run, found) <= 1e-12


# --- high precision


class HighPrecision:
    """All outputs of a cable by the textbook's equations, in 50 digits."""

    def __init__(self, cable: OneCable, x: np.ndarray, start: np.ndarray) -> None:
        """Begin at start = (H, V_B, T_A), a solution to some digits."""
        mpmath.mp.dps = 50
        self.cable = cable
        self.w, self.run, self.td = map(mpmath.mpf, (cable.w, cable.run, cable.damping_time))
        self.law = [mpmath.mpf(float(a)) for a in cable.law]
        self.x = [mpmath.mpf(float(a)) for a in x]
        self.start = mpmath.matrix([mpmath.mpf(float(a)) for a in start])
        for _ in range(2):  # the second time about the solution
            self.inverse = self._slope() ** -1
            self.start = self._solve(self.x)

    def _terms(self, x: list, unknown: mpmath.matrix) -> tuple:
        H, V_B, T_A = unknown
        EA = self.law[0] - self.law[1] / (T_A + self.law[2])
        l0 = x[6] - self.run / (1 + T_A / EA)
        V_A = V_B - self.w * l0
        return EA, l0, V_A, mpmath.sqrt(H * H + V_A * V_A), mpmath.sqrt(H * H + V_B * V_B)

    def _equations(self, x: list, unknown: mpmath.matrix) -> mpmath.matrix:
        H, V_B, T_A = unknown
        EA, l0, V_A, end_A, end_B = self._terms(x, unknown)
        return mpmath.matrix(
            [
                H * l0 / EA + H / self.w * (mpmath.asinh(V_B / H) - mpmath.asinh(V_A / H))
                - mpmath.sqrt(x[0] ** 2 + x[1] ** 2),
                (V_A * l0 + self.w * l0 * l0 / 2) / EA + (end_B - end_A) / self.w - x[2],
                end_A - T_A,
            ]
        )  # fmt: skip

    def _slope(self) -> mpmath.matrix:
        at, slope = self._equations(self.x, self.start), mpmath.matrix(3, 3)
        for j in range(3):
            moved = self.start.copy()
            moved[j] *= 1 + mpmath.mpf(10) ** -25
            slope[:, j] = (self._equations(self.x, moved) - at) / (moved[j] - self.start[j])
        return slope

    def _solve(self, x: list) -> mpmath.matrix:
        unknown = self.start.copy()
        for _ in range(300):
            step = self.inverse * self._equations(x, unknown)
            unknown -= step
            if all(abs(step[i]) < abs(unknown[i]) * mpmath.mpf(10) ** -40 for i in range(3)):
                return unknown
        raise AssertionError(f"no convergence in 50 digits: {self.x}")

    def _tension(self, x: list) -> mpmath.mpf:
        """Return the tension in the middle of the span."""
        H, V_B, _ = unknown = self._solve(x)
        V_A = self._terms(x, unknown)[2]
        return mpmath.sqrt(H * H + ((V_A + V_B) / 2) ** 2)

    def _stretch(self, x: list, T_A: mpmath.mpf) -> list:
        """Return the gradient of the cable's stretch by the place of B and by the length."""
        step, slopes = mpmath.mpf(10) ** -14, []
        for j in (0, 1, 2, 6):
            ends = []
            for side in (1, -1):
                moved = list(x)
                moved[j] += side * step
                ends.append(self._tension(moved))
            slopes.append((ends[0] - ends[1]) / (2 * step))
        strain = mpmath.diff(lambda T: T / (self.law[0] - self.law[1] / (T + self.law[2])), T_A)
        return [x[6] * strain * slope for slope in slopes]

    def outputs(self, x: list | None = None) -> list:
        x = x or self.x
        H, V_B, T_A = unknown = self._solve(x)
        EA, l0, V_A, _, T_B = self._terms(x, unknown)
        Bx = mpmath.sqrt(x[0] ** 2 + x[1] ** 2)
        t_A = [H * x[0] / Bx / T_A, H * x[1] / Bx / T_A, V_A / T_A]
        t_B = [H * x[0] / Bx / T_B, H * x[1] / Bx / T_B, V_B / T_B]
        *e_B, e_l = self._stretch(x, T_A)
        e_t = sum(a * b for a, b in zip(e_B, t_B, strict=True))
        rates = [*x[3:6], x[7]]
        T_d = EA * self.td / x[6] * sum(a * b for a, b in zip([*e_B, e_l], rates, strict=True))
        if e_l * T_d > T_A:
            T_d = T_A / e_l
        if -e_t * T_d > T_B:
            T_d = -T_B / e_t
        dbeta = mpmath.atan2(V_B, H) - mpmath.atan2(x[2], Bx)
        force = [-T_B * t - T_d * e for t, e in zip(t_B, e_B, strict=True)]
        return [*force, T_A - e_l * T_d, T_B + e_t * T_d, *t_A, *t_B, dbeta, H, l0]

    def jacobian(self) -> np.ndarray:
        step, columns = mpmath.mpf(10) ** -12, []
        for j in range(8):
            ends = []
            for side in (1, -1):
                x = list(self.x)
                x[j] += side * step
                ends.append(self.outputs(x))
            columns.append([float((a - b) / (2 * step)) for a, b in zip(*ends, strict=True)])
        return np.array(columns).T


def assert_same_jacobian(found, expected, cable: OneCable, x: np.ndarray, tolerance: float) -> None:
    """Compare by output and by place or rate, relative to the block's largest entry.

    A block that all but cancels is measured by 1e-4 of what is usual for its output.
    """
    EA, L = cable.law[0], np.linalg.norm(x[:3])
    usual = {"t_A": 1 / L, "t_B": 1 / L, "dbeta": 1 / L, "l0": 1.0}
    for name, rows in OUTPUTS.items():
        for columns in (PLACE, RATE):
            block = expected[rows][:, columns]
            scale = np.abs(block).max()
            if columns == RATE and name in {*usual, "H"}:
                assert not found[rows][:, columns].any(), (name, x)
                continue
            unit = usual.get(name, EA / x[6]) * (cable.damping_time if columns == RATE else 1)
            error = np.abs(found[rows][:, columns] - block).max()
            assert error <= tolerance * max(scale, 1e-4 * unit), (name, columns, cable.law, x)


NEAR_VERTICAL = (-5.5, -3.0)  # exponents of the tilt


@pytest.mark.parametrize("tilt", [None, NEAR_VERTICAL], ids=["all round", "near vertical"])
@pytest.mark.parametrize("sag", ["taut", "between", "slack"])
def test_outputs_and_jacobian_in_high_precision(sag: str, tilt) -> None:
    for cable, x in some_cables(15, 3, sag, tilt):
        out, jacobian = cable.jacobian(x)
        rest = x.copy()
        rest[3:6] = rest[7] = 0
        at_rest = cable(rest)
        exact = HighPrecision(cable, x, np.array([at_rest[12], -at_rest[2], at_rest[3]]))
        expected = np.array([float(a) for a in exact.outputs()])
        for rows in OUTPUTS.values():
            error = np.abs(out[rows] - expected[rows]).max()
            # Where the damping is cut back, what is left is a small difference of two tensions.
            scale = max(np.abs(expected[rows]).max(), np.abs(at_rest[rows]).max())
            assert error <= 3e-11 * scale, (rows, x)
        assert_same_jacobian(jacobian, exact.jacobian(), cable, x, 1e-9)


@pytest.mark.parametrize("name", CLASSES)
def test_plain_span_in_high_precision(name: str) -> None:
    for row in random_cables(name, 5, np.random.default_rng(4)):
        Bx, Bz, l0, w, EA = row
        H, V_B, *_ = catenary.solve_catenary(Bx, Bz, l0, w, EA)
        cable = OneCable(w, np.array([EA, 0.0, 1.0]), 0.0)
        x = np.array([Bx, 0, Bz, 0, 0, 0, l0, 0])
        exact = HighPrecision(cable, x, np.array([H, V_B, np.hypot(H, V_B - w * l0)])).start
        # Near the vertical a tiny H is known to fewer digits; the force is as good as the rounding
        # of w l0, and of the length times the stiffness, allows.
        known = 1e-12 * (abs(V_B) + H + w * l0) + 4e-16 * EA
        assert abs(H - exact[0]) <= min(known, 1e-7 * exact[0]), row
        assert abs(V_B - exact[1]) <= known, row


@pytest.mark.parametrize(
    "H, V_B, l0, w, EA",
    [
        (10.0, 7e-4, 10.0, 1e-4, 1e10),  # level and tight: all but the stretch nearly cancels
        (10.0, -7.0, 10.0, 1e-4, 1e10),
        (300.0, -170.0, 8.0, 0.65, 1.3e6),
        (2.0, 5.0, 10.0, 1.0, 1e6),  # a deep sag
        (2.0, 18.0, 10.0, 1.5, 1e6),
        (1e-3, -2.0, 10.0, 1.0, 1e6),
        (1e-6, 90.0, 10.0, 8.0, 1e6),
    ],
)
def test_stiffness_keeps_its_digits(H: float, V_B: float, l0: float, w: float, EA: float) -> None:
    _, _, _, *K = catenary._linearise(H, V_B, l0, l0, 0.0, w, EA, 0.0, 1.0)[:7]
    mpmath.mp.dps = 50
    H, V_B, l0, w, EA = map(mpmath.mpf, (H, V_B, l0, w, EA))
    V_A = V_B - w * l0
    T_A, T_B = mpmath.hypot(H, V_A), mpmath.hypot(H, V_B)
    bend = (V_B / T_B - V_A / T_A) / w
    turn = (mpmath.asinh(V_B / H) - mpmath.asinh(V_A / H)) / w
    shear = H / w * (1 / T_B - 1 / T_A)
    exact = mpmath.matrix([[l0 / EA + turn - bend, shear], [shear, l0 / EA + bend]]) ** -1
    np.testing.assert_allclose(K, [float(a) for a in exact], rtol=1e-12)


def test_sag_angle_keeps_its_digits_where_it_is_tiny() -> None:
    cable = OneCable(1e-6, np.array([1e6, 0.0, 1.0]), 0.0)
    x = np.array([3.0, 4.0, -6.0, 0, 0, 0, 7.8, 0])
    out = cable(x)
    exact = HighPrecision(cable, x, np.array([out[12], -out[2], out[3]])).outputs()[11]
    assert exact < 1e-8
    assert abs(out[11] - exact) <= 1e-11 * exact


# --- the Jacobian against differences of the forces themselves


@pytest.mark.parametrize("tilt", [None, (-4.0, -2.0)], ids=["all round", "near vertical"])
@pytest.mark.parametrize("sag", ["taut", "between", "slack"])
def test_jacobian_against_central_differences(sag: str, tilt) -> None:
    for cable, x in some_cables(40, 5, sag, tilt):
        out, jacobian = cable.jacobian(x)
        np.testing.assert_array_equal(out, cable(x))
        size = min(np.linalg.norm(x[:3]), 300 * np.hypot(x[0], x[1]))
        sizes = np.full(8, 5e-7 * size)
        sizes[RATE] = 1e-3  # forces are linear in the rates
        found = np.column_stack([central(cable, x, step) / step.max() for step in np.diag(sizes)])
        assert_same_jacobian(jacobian, found, cable, x, 1e-6)


@pytest.mark.parametrize("lean", [0.0, 1e-9, 3e-7])
@pytest.mark.parametrize("length", [6.99, 7.3])
def test_a_vertical_cable_is_well_defined(lean: float, length: float) -> None:
    cable = OneCable(0.7, np.array([1e6, 0.0, 1.0]), 0.0, 1e-3)
    x = np.array([lean * 7, 0, -7, 0.2, 0.1, -0.3, length, 0.02])
    out, jacobian = cable.jacobian(x)
    np.testing.assert_allclose(np.linalg.norm(out[5:8]), 1, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(out[8:11]), 1, rtol=1e-12)
    # across, the force is proportional to the lean
    K = -jacobian[:3, :3]
    np.testing.assert_allclose(-out[:2], K[:2, :2] @ x[:2], rtol=1e-9, atol=2e-12 * out[3])
    assert K[0, 0] > 0
    np.testing.assert_allclose(K[1, 1], K[0, 0], rtol=1e-6)
    steps = np.eye(8) * 1e-6
    steps[:2] *= 0.5  # stay where the plane of the cable is held, to 7e-6 m
    found = np.column_stack([central(cable, x, step) / step.max() for step in steps])
    scale = np.abs(jacobian[:5]).max()
    np.testing.assert_allclose(jacobian[:5], found[:5], rtol=1e-6, atol=1e-8 * scale)


def test_direction_turns_the_forces_with_it() -> None:
    cable = OneCable(0.7, np.array([1e6, 1e8, 300.0]), 5.4, 1e-3)
    x = np.array([3.0, 0.0, -4.0, 0.1, 0.2, -0.3, 10.39, 0.02])
    turn = np.array([[0.28, -0.96, 0.0], [0.96, 0.28, 0.0], [0.0, 0.0, 1.0]])
    turned = np.concatenate([turn @ x[:3], turn @ x[3:6], x[6:]])
    one, other = cable(x), cable(turned)
    for vector in (slice(0, 3), slice(5, 8), slice(8, 11)):
        np.testing.assert_allclose(other[vector], turn @ one[vector], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(other[[3, 4, 11, 12, 13]], one[[3, 4, 11, 12, 13]], rtol=1e-10)


# --- physics


@pytest.mark.parametrize("sag", ["taut", "between", "slack"])
def test_end_forces_carry_the_weight_of_the_span(sag: str) -> None:
    for cable, x in some_cables(50, 6, sag):
        x[3:6] = x[7] = 0
        out = cable(x)
        on_base = out[3] * out[5:8]
        balance = on_base + out[:3] + [0, 0, cable.w * out[13]]
        assert np.abs(balance).max() <= 1e-13 * (out[3] + out[4])
        assert abs(np.linalg.norm(out[5:8]) - 1) < 1e-14 > abs(np.linalg.norm(out[8:11]) - 1)
        assert out[11] >= 0


def test_run_and_law_reduce_to_the_plain_span() -> None:
    # The run in series: the same tension in a plain span of the length that is left.
    p = np.array([[3.0, 4.0, -5.0], [-7.0, 1.0, -4.0], [2.0, 2.0, 3.0]])
    law = AxialStiffness(asymptote=6e5, softening=4e7, offset=150.0)
    L = np.linalg.norm(p, axis=1)
    for length in (L / 1.001 + 5.4, L * 1.02 + 5.4):
        state = elastic_catenary(p, length, 0.65, law, 5.4)
        T_A = state.tension_at_drawing_point
        EA = law(T_A)
        l0 = length - 5.4 / (1 + T_A / EA)
        np.testing.assert_allclose(state.unstrained_span_length, l0, rtol=1e-14)
        for i in range(3):
            plain = elastic_catenary(p[i : i + 1], l0[i], 0.65, float(EA[i]))
            np.testing.assert_allclose(
                plain.force_on_platform[0], state.force_on_platform[i], rtol=1e-9
            )


def test_run_alone_is_a_spring_in_series() -> None:
    # A weightless cable: T / EA = (L + R - length) / length.
    state = elastic_catenary([[3.0, 0.0, 4.0]], 10.35, 0.0, 1e6, 5.4)
    np.testing.assert_allclose(state.tension_at_drawing_point, 1e6 * 0.05 / 10.35, rtol=1e-9)


def test_reciprocity_and_symmetry_of_a_constant_stiffness() -> None:
    p = np.random.default_rng(8).normal(size=(30, 3)) * 10
    L = np.linalg.norm(p, axis=1)
    EA, run = 8e5, 5.4
    length = L * np.linspace(0.998, 1.1, 30) + run
    state = elastic_catenary(p, length, 2.0, EA, run)
    K = -state.position_stiffness
    np.testing.assert_allclose(K, K.transpose(0, 2, 1), rtol=1e-10, atol=1e-10 * K.max())
    assert np.linalg.eigvalsh(K).min() > 0
    for i in range(30):
        cable = OneCable(2.0, np.array([EA, 0.0, 1.0]), run)
        _, jacobian = cable.jacobian(np.array([*p[i], 0, 0, 0, length[i], 0]))
        slope = state.length_stiffness[i] / (1 + state.tension_at_drawing_point[i] / EA)
        scale = np.abs(slope).max()
        np.testing.assert_allclose(jacobian[3, :3], slope, rtol=1e-9, atol=1e-11 * scale)


def old_damping(cable: OneCable, x: np.ndarray, EA: float) -> float:
    """Return EA t_d (L' - l')/l [N], which holds for a cable without sag."""
    return EA * cable.damping_time * (x[:3] @ x[3:6] / np.linalg.norm(x[:3]) - x[7]) / x[6]


@pytest.mark.parametrize("kind", KINDS)
def test_damping_of_a_straight_cable_is_that_of_its_chord(kind: str) -> None:
    """Weightless, so that lambda^2 is 0: for the platform's motion at any strain, and for the
    winch's but for the strain, since it is stretched cable that it pays out."""
    law, run = law_of(6e5, kind)
    p = np.array([3.0, 4.0, -5.0])
    L = np.linalg.norm(p)
    # The law of softening takes T_A, which even a weight of 1e-9 N/m tells from T in the middle.
    softens = law[1] != 0.0
    digits = 1e-11 if softens else 1e-12
    for strain in (2e-3,) if softens else (1e-5, 2e-3):
        for rate in (0.0, -0.01):
            x = np.array([*p, 0.03, 0.01, -0.02, (L + run) / (1 + strain), rate])
            still, cable = OneCable(0.0, law, run), OneCable(0.0, law, run, 1e-3)
            rest, moving = still(x), cable(x)
            EA = secant(law, rest[3])
            pays_out = x.copy()
            pays_out[7] *= 1 + rest[3] / EA
            T_d = old_damping(cable, pays_out, EA)
            assert T_d > 0
            rounding = 4 * EPS * (rest[3] + T_d)
            assert abs(moving[4] - rest[4] - T_d) <= digits * T_d + rounding
            at_A = T_d * (1 + rest[3] / EA)
            assert abs(moving[3] - rest[3] - at_A) <= digits * at_A + rounding
            np.testing.assert_allclose(moving[:3], -moving[4] * p / L, rtol=1e-9)


def test_damping_is_of_the_stretch_not_of_the_sag() -> None:
    """Beside the exact sum over the span of EA t_d times the rate of strain squared, for which the
    tension of each element at rest is differentiated by the place of B and the length."""
    EA, run, L, w, t_d = 5e5, 5.4, 40.0, 0.6, 1e-3
    law = np.array([EA, 0.0, 1.0])
    cable = OneCable(w, law, run, t_d)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    for slope in (-1.0, -0.3, 0.6):
        for sag, tolerance in ((0.05, 1e-3), (0.2, 0.01), (0.4, 0.04)):  # w Bx / T
            p = L * np.array([np.cos(slope), 0.0, np.sin(slope)])
            T = w * p[0] / sag
            length = L * (1 + sag**2 / 24) / (1 + T / EA) + run / (1 + T / EA)

            def tensions(q: np.ndarray, p: np.ndarray = p) -> np.ndarray:
                out = OneCable(w, law, run)(np.array([*q[:3], 0, 0, 0, q[3], 0]))
                V = -out[2] - w * out[13] * (nodes + 1) / 2  # from B
                return np.append(np.hypot(out[12], V), out[3])

            q = np.array([*p, length])
            gradient = np.column_stack(
                [central(tensions, q, step) / step.max() for step in np.eye(4) * 2e-5]
            )
            l0 = cable(np.array([*p, 0, 0, 0, length, 0]))[13]
            shares = np.append(weights / 2 * l0, length - l0)
            exact = t_d / EA * np.einsum("n,ni,nj->ij", shares, gradient, gradient)
            _, jacobian = cable.jacobian(np.array([*p, 0, 0, 0, length, 0]))
            ours = -jacobian[[0, 1, 2, 3]][:, RATE]
            np.testing.assert_allclose(ours, exact, atol=tolerance * np.abs(exact).max())
            chord = old_damping(cable, np.array([*p, *p / L, length, 0]), EA)
            lambda2 = sag**2 * L * EA / (T * length)
            along = p / L @ ours[:3, :3] @ p / L
            assert along * (1 + lambda2 / 12) ** 2 == pytest.approx(chord, rel=0.01 + 2 * tolerance)


def test_damping_takes_energy_out() -> None:
    """10,000 cables, taut, in between, slack; moving slowly, or so fast that damping is cut."""
    worst, cut = 0.0, 0
    for sag in ("taut", "between", "slack"):
        for tilt in (None, NEAR_VERTICAL):
            for cable, x in some_cables(1667, 8, sag, tilt):
                rest = OneCable(cable.w, cable.law, cable.run)(x)
                moving = cable(x)
                change = moving - rest
                # Power from the platform and the winch, less what comes back.
                taken = -(change[:3] @ x[3:6]) - change[3] * x[7]
                # Rounding of the forces times the rates.
                size = np.abs(moving[:3]).max() + np.abs(rest[:3]).max() + moving[3] + rest[3]
                worst = min(worst, taken / (EPS * size * np.abs(x[[3, 4, 5, 7]]).sum()))
                assert moving[3] >= 0.0 and moving[4] >= 0.0
                cut += moving[3] == 0.0 or moving[4] <= 1e-14 * rest[4]
    assert worst >= -20.0
    assert cut > 100


def test_slack_cables_hardly_damp() -> None:
    """Damping falls to nothing as a cable goes slack, first as 1/(1 + lambda^2/12)^2."""
    EA, L, w = 5e5, 40.0, 0.6
    p = L * np.array([0.8, 0.0, -0.6])
    parts = {}
    for slack in (0.999, 0.9999, 1.0, 1.0005, 1.002, 1.01, 1.05, 1.3, 2.0, 5.0):
        length = slack * L
        cable = OneCable(w, np.array([EA, 0.0, 1.0]), 0.0, 1e-3)
        out, jacobian = cable.jacobian(np.array([*p, 0, 0, 0, length, 0]))
        damping = np.linalg.eigvalsh(-jacobian[:3, 3:6])
        assert damping[0] >= -1e-9 * damping[2]
        parts[slack] = damping[2] / (EA * 1e-3 / length)
        T = out[12] / 0.8
        lambda2 = (0.8 * w * L / T) ** 2 * EA / T
        if slack < 1.002:
            assert parts[slack] == pytest.approx((1 + lambda2 / 12) ** -2, rel=0.1)
    assert np.all(np.diff(list(parts.values()))[:7] < 0)
    assert parts[0.999] > 0.8 and parts[1.01] < 1e-4
    assert max(parts[slack] for slack in (1.3, 2.0, 5.0)) < 1e-7


@pytest.mark.parametrize("height", [-5.0, 5.0], ids=["hanging", "standing"])
def test_damping_never_makes_a_cable_push(height: float) -> None:
    law = np.array([6e5, 0.0, 1.0])
    still, cable = OneCable(0.65, law, 0.0), OneCable(0.65, law, 0.0, 2e-2)
    for velocity, rate in ((np.array([-30.0, -40.0, -10.0 * height]), 0.0), (np.zeros(3), 1e3)):
        x = np.array([3.0, 4.0, height, *velocity, 7.05, rate])
        rest, moving = still(x), cable(x)
        assert rest[3:5].min() > 1000.0
        assert 0.0 <= moving[3:5].min() <= 1e-12 and moving[3:5].max() < 10.0
        # What is left on the platform is across the cable, or of the size of what is left of T_B.
        assert np.linalg.norm(moving[:3]) <= moving[4] + 0.01 * rest[4]


# --- energy and shape


def energy_cases() -> tuple[np.ndarray, np.ndarray, float]:
    p = np.array([[3.0, 4.0, -5.0], [7.0, 1.0, -4.0], [2.0, 2.0, 3.0], [0.02, 0.01, -5.0]])
    return p, np.linalg.norm(p, axis=1), 8e5


@pytest.mark.parametrize("run", [0.0, 5.4])
@pytest.mark.parametrize("stretch", [0.999, 1.01, 1.2])
def test_energy_has_the_forces_as_its_slopes(run: float, stretch: float) -> None:
    p, L, EA = energy_cases()
    length, w = L * stretch + run, 1.3
    state = elastic_catenary(p, length, w, EA, run)
    T_A = state.tension_at_drawing_point
    tolerance = 1e-7 * T_A.max()
    for j in range(3):
        step = np.zeros(3)
        step[j] = 2e-5
        slope = central(lambda q: cable_energy(q, length, w, EA, run), p, step) / 2e-5
        np.testing.assert_allclose(slope, -state.force_on_platform[:, j], atol=tolerance)
    slope = central(lambda a: cable_energy(p, a, w, EA, run), length, np.array(2e-5)) / 2e-5
    np.testing.assert_allclose(slope, -T_A * (1 + T_A / (2 * EA)), atol=tolerance)


@pytest.mark.parametrize("stretch", [0.999, 1.01, 1.2])
def test_energy_is_the_sum_of_its_parts(stretch: float) -> None:
    p, L, EA = energy_cases()
    run, w = 5.4, 1.3
    length = L * stretch + run
    state = elastic_catenary(p, length, w, EA, run)
    nodes, weights = np.polynomial.legendre.leggauss(10)
    panels = np.arange(3000)[:, None]  # many, for the sharp bend of the cable that hangs as a loop
    for i in range(len(p)):
        H, l0 = state.horizontal_tension[i], state.unstrained_span_length[i]
        V_A = -state.force_on_platform[i, 2] - w * l0
        T_A = state.tension_at_drawing_point[i]
        s = l0 / 3000 * (panels + 0.5 * (1 + nodes))
        T = np.hypot(H, V_A + w * s)
        z = V_A * s / EA + w * s * s / (2 * EA) + (T - T_A) / w
        span = l0 / 6000 * ((T * T / (2 * EA) + w * z) @ weights).sum()
        in_run = T_A**2 / (2 * EA) * (length[i] - l0)
        found = cable_energy(p[i : i + 1], length[i], w, EA, run)[0]
        np.testing.assert_allclose(found, span + in_run, rtol=1e-9)


def test_energy_refuses_a_law_without_potential() -> None:
    law = AxialStiffness(asymptote=6e5, softening=4e7, offset=150.0)
    with pytest.raises(ValueError, match="depends on the tension"):
        cable_energy([[3.0, 4.0, -5.0]], 7.0, 0.65, law)
    constant = AxialStiffness(asymptote=6e5)
    found = cable_energy([[3.0, 4.0, -5.0]], 7.0, 0.65, constant)
    assert found == cable_energy([[3.0, 4.0, -5.0]], 7.0, 0.65, 6e5)


@pytest.mark.parametrize("stretch", [0.998, 1.001, 1.3])
def test_a_piece_of_the_shape_hangs_by_itself(stretch: float) -> None:
    p = np.array([[3.0, 4.0, -5.0], [7.0, 1.0, -4.0], [2.0, 2.0, 3.0], [1e-3, 0.0, -5.0]])
    start = np.array([1.0, 2.0, 3.0])
    w, EA, n = 1.3, 8e5, 9
    state = elastic_catenary(p, np.linalg.norm(p, axis=1) * stretch, w, EA)
    l0, H = state.unstrained_span_length, state.horizontal_tension
    points = cable_shape(start + 0 * p, start + p, H, -state.force_on_platform[:, 2], l0, w, EA, n)
    assert points.shape == (4, n, 3)
    np.testing.assert_allclose(points[:, 0], start + 0 * p, atol=1e-13)
    np.testing.assert_allclose(points[:, -1], start + p, atol=1e-13)
    for m in range(1, n):
        piece = elastic_catenary(points[:, m] - start, l0 * m / (n - 1), w, EA)
        # 1e-14 m of stretch, which is what the points are good to, is 1e-9 N
        np.testing.assert_allclose(piece.horizontal_tension, H, rtol=1e-7, atol=1e-8)
        T_A = state.tension_at_drawing_point
        np.testing.assert_allclose(piece.tension_at_drawing_point, T_A, rtol=1e-9, atol=1e-8)


def test_shape_of_a_hairpin_reaches_its_lowest_point() -> None:
    shape = cable_shape([[0, 0, 0]], [[0, 0, -2.0]], [0.0], [1.5], 5.0, 1.0, 1e6, 101)[0]
    assert np.isfinite(shape).all()
    assert shape[:, 2].min() == pytest.approx(-3.5, abs=1e-4)


# --- refusals


GOOD = {
    "p_WA": np.zeros((3, 3)),
    "p_WB": np.array([[3.0, 4.0, -5.0], [7.0, 1.0, -4.0], [2.0, 2.0, 3.0]]),
    "v_WB": np.zeros((3, 3)),
    "length": np.array([12.5, 13.5, 9.6]),
    "length_rate": np.zeros(3),
    "w": 0.65,
    "stiffness": np.array([6e5, 4e7, 150.0]),
    "drum_run": np.full(3, 5.4),
    "damping_time": 1e-3,
}


def run_kernels(changes: dict) -> set[int]:
    arguments = list({**GOOD, **changes}.values())
    out, jacobian = np.zeros((3, 14)), np.zeros((3, 14, 8))
    return {
        catenary.cable_forces(*arguments, out),
        catenary.cable_forces_jacobian(*arguments, out, jacobian),
    }


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["p_WA", "p_WB", "v_WB", "length", "length_rate", "drum_run"])
def test_a_number_that_is_not_finite_names_its_cable(name: str, bad: float) -> None:
    assert run_kernels({}) == {0}
    changed = GOOD[name].copy()
    changed[1] = bad
    assert run_kernels({name: changed}) == {2}


@pytest.mark.parametrize(
    "name, bad",
    [
        ("w", np.nan),
        ("w", -0.1),
        ("damping_time", np.nan),
        ("damping_time", -1e-3),
        ("stiffness", np.array([0.0, 0.0, 1.0])),
        ("stiffness", np.array([-1e6, 0.0, 1.0])),
        ("stiffness", np.array([6e5, np.nan, 1.0])),
        ("stiffness", np.array([6e5, 6.1e5 * 150, 150.0])),  # EA(0) < 0
        ("stiffness", np.array([6e5, 4e7, -1.0])),
    ],
)
def test_a_bad_number_of_all_cables_fails_the_first(name: str, bad) -> None:
    assert run_kernels({name: bad}) == {1}


@pytest.mark.parametrize("length", [5.4, 3.0, 0.0, -1.0])
def test_a_length_that_leaves_no_span_is_refused(length: float) -> None:
    lengths = GOOD["length"].copy()
    lengths[2] = length
    assert run_kernels({"length": lengths}) == {3}
    with pytest.raises(CableError, match=r"cable 3: .* of which 5\.4 m run"):
        elastic_catenary(GOOD["p_WB"], lengths, 0.65, 6e5, 5.4)


def test_attachment_point_at_drawing_point_is_refused() -> None:
    points = GOOD["p_WB"].copy()
    points[0] = 0
    assert run_kernels({"p_WB": points}) == {1}


@pytest.mark.parametrize(
    "bad", [(0.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (np.nan, 1.0), (1.0, np.inf)]
)
def test_plain_solver_refuses_with_a_status(bad: tuple[float, float]) -> None:
    Bx, l0 = bad
    assert catenary.solve_catenary(Bx, -1.0, l0, 1.0, 1e6)[3] == 1


def test_error_is_a_cable_error_without_a_time() -> None:
    with pytest.raises(CableError) as caught:
        elastic_catenary([[1.0, 0.0, 0.0], [np.nan, 0.0, 0.0]], 1.0, 0.65, 6e5)
    assert caught.value.cable == 2
    assert str(caught.value).startswith("cable 2: ")
    assert caught.value.time is None
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_many_cables_in_one_call_are_as_each_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(public, "BLOCK", 7)
    generator = np.random.default_rng(0)
    p = generator.uniform([-9.0, -9.0, -5.0], [9.0, 9.0, -1.0], (23, 3))
    length = np.linalg.norm(p, axis=1) * generator.uniform(0.998, 1.05, 23)
    run = generator.uniform(0.0, 5.0, 23)
    law = AxialStiffness(asymptote=6e5, softening=3e7, offset=200.0)
    together = vars(elastic_catenary(p, length + run, 0.65, law, run))
    for i in range(23):
        alone = vars(elastic_catenary(p[i], length[i] + run[i], 0.65, law, run[i]))
        for name, values in alone.items():
            np.testing.assert_array_equal(together[name][i], values[0], err_msg=name)
    length[17] = -1.0
    with pytest.raises(CableError, match=r"cable 18: .* length -1 m"):
        elastic_catenary(p, length, 0.65, law)


def test_shapes_that_do_not_match_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\(k, 3\)"):
        elastic_catenary([[1.0, 0.0]], 1.0, 0.65, 6e5)
    with pytest.raises(ValueError):
        elastic_catenary([[1.0, 0.0, 0.0]], [1.0, 2.0], 0.65, 6e5)


# --- with and without numba

# Also run by another interpreter, uncompiled: prints nothing, writes all outputs.
UNCOMPILED = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from test_catenary import both_ways, is_compiled
assert not is_compiled()
np.save(sys.argv[2], both_ways())
"""


def both_ways() -> np.ndarray:
    """Return outputs and Jacobians of cables of all sorts, and of numbers out of all proportion."""
    results = []
    for sag in ("taut", "between", "slack"):
        for tilt in (None, NEAR_VERTICAL):
            for cable, x in some_cables(10, 11, sag, tilt):
                out, jacobian = cable.jacobian(x)
                for rows in OUTPUTS.values():
                    for block in (out[rows], jacobian[rows]):
                        results += [*(block / max(np.abs(block).max(), 1e-30)).ravel()]
    results += catenary.irvine_row(7.0, -4.0, 400.0, 0.65, 1.3e6)
    generator = np.random.default_rng(12)
    for _ in range(300):
        n = generator.uniform(-320, 308, 12)
        arguments = {
            "p_WB": generator.choice([-1, 1], (3, 3)) * 10 ** generator.choice(n, (3, 3)),
            "length": 10 ** generator.choice(n, 3),
            "drum_run": 10 ** generator.choice(n, 3),
            "v_WB": 10 ** generator.choice(n, (3, 3)),
            "w": float(10 ** generator.choice(n)),
            "stiffness": 10 ** generator.choice(n, 3),
        }
        tame = generator.random(6) < 0.8
        arguments = {k: v for (k, v), t in zip(arguments.items(), tame, strict=True) if not t}
        out, jacobian = np.zeros((3, 14)), np.zeros((3, 14, 8))
        status = catenary.cable_forces_jacobian(*{**GOOD, **arguments}.values(), out, jacobian)
        solved = status - 1 if status else 3
        assert np.isfinite(out[:solved]).all() and np.isfinite(jacobian[:solved]).all(), arguments
        results.append(status)
    return np.array(results)


def test_compiled_and_uncompiled_agree(tmp_path: Path) -> None:
    here = both_ways()
    if not is_compiled():
        return  # this run is the uncompiled one, and numbers out of all proportion raised nothing
    file = tmp_path / "uncompiled.npy"
    root = Path(__file__).resolve().parents[1]
    environment = {
        **os.environ,
        "CDPR_DRAKE_NUMBA": "0",
        "PYTHONPATH": os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")]),
    }
    command = [sys.executable, "-c", UNCOMPILED, str(Path(__file__).parent), str(file)]
    subprocess.run(command, check=True, env=environment, timeout=120)
    np.testing.assert_allclose(here, np.load(file), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"w": -1.0}, "w must be from 0"),
        ({"w": np.nan}, "w must be from 0"),
        ({"w": 1e12}, "w must be from 0"),
        ({"stiffness": np.inf}, "stiffness must be from"),
        ({"stiffness": 1e18}, "stiffness must be from"),
        ({"stiffness": -3.0}, "stiffness must be from"),
        ({"length": np.nan}, "length must be from"),
        ({"length": 1e12}, "length must be from"),
        ({"drum_run": -1.0}, "drum_run must be from"),
        ({"p_AB": [[0.0, 0.0, 0.0]]}, "p_AB, the chord, must be from"),
        ({"drum_run": 6.0}, "no elastic catenary of unstrained length 5.1 m, of which 6 m run"),
    ],
)
def test_what_has_no_catenary_is_named(changes: dict, name: str) -> None:
    good = {"p_AB": [[3.0, 4.0, 0.0]], "length": 5.1, "w": 0.6, "stiffness": 5e5, "drum_run": 0.0}
    elastic_catenary(**good)
    with pytest.raises(CableError, match=re.escape(name)):
        elastic_catenary(**{**good, **changes})
