"""Tension distributions against published figures, a linear programme and a second solver."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from cdpr_drake.errors import TensionError
from cdpr_drake.model.distribution import (
    barycentre,
    bounded_distribution,
    feasibility_margin,
    minimum_norm_within,
)

# A planar point mass between four anchors, pulled towards them.
ANCHORS = 0.315 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
PLATFORM = np.array([0.080, 0.045])
PLANAR = ((ANCHORS - PLATFORM) / np.linalg.norm(ANCHORS - PLATFORM, axis=1)[:, None]).T
PLANAR_WRENCH = np.array([-4.955131227, 0.055732486])
LOW, HIGH = 3.8, 25.0


def test_the_planar_case_of_the_literature() -> None:
    args: Any = (PLANAR, PLANAR_WRENCH, LOW, HIGH)
    least = minimum_norm_within(*args)
    np.testing.assert_allclose(least, [5.209314465, 3.8, 3.8, 6.876421727], rtol=0, atol=2e-9)
    close = bounded_distribution(*args, 14.4)
    np.testing.assert_allclose(close, [13.4114, 13.2868, 15.4935, 15.1140], rtol=0, atol=6e-5)
    middle = barycentre(*args)
    np.testing.assert_allclose(middle, [13.5537, 13.0295, 15.5338, 14.8482], rtol=0, atol=6e-5)
    found = feasibility_margin(*args)
    assert found.margin == pytest.approx(9.546750, abs=1e-6)
    np.testing.assert_allclose(PLANAR @ found.tension, PLANAR_WRENCH, atol=1e-9)
    unbounded = minimum_norm_within(PLANAR, PLANAR_WRENCH, -100.0, 100.0)
    np.testing.assert_allclose(unbounded, [1.797, -1.481, -1.579, 2.157], rtol=0, atol=6e-4)


def problems(count: int, seed: int) -> list[tuple[np.ndarray, np.ndarray, float, float]]:
    """Return random (matrix, wrench, lower, upper) of 7 to 12 cables, some infeasible."""
    draw = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        k = int(draw.integers(7, 13))
        u = draw.normal(size=(k, 3))
        u /= np.linalg.norm(u, axis=1)[:, None]
        arm = draw.uniform(-0.5, 0.5, (k, 3))
        A = np.hstack([np.cross(arm, u), u]).T
        low, high = 10.0, float(draw.uniform(50.0, 2000.0))
        t = draw.uniform(-0.3, 1.3, k) * (high - low) + low
        found.append((A, A @ t, low, high))
    return found


def test_feasibility_is_that_of_a_linear_programme() -> None:
    """1000 problems, HiGHS asked for a point of the box instead of a margin."""
    told = {True: 0, False: 0}
    for A, w, low, high in problems(1000, 1):
        inside = linprog(np.zeros(A.shape[1]), A_eq=A, b_eq=w, bounds=(low, high)).status == 0
        margin = feasibility_margin(A, w, low, high)
        if abs(margin.margin) < 1e-6 * high:
            continue  # on the edge, where the solvers' own tolerance decides
        assert (margin.margin > 0.0) == inside
        np.testing.assert_allclose(A @ margin.tension, w, atol=1e-7 * high)
        room = np.minimum(margin.tension - low, high - margin.tension).min()
        assert room == pytest.approx(margin.margin, abs=1e-7 * high)
        try:
            t = minimum_norm_within(A, w, low, high)
        except TensionError as error:
            assert not inside and "no tensions between" in str(error)
        else:
            assert inside and low <= t.min() and t.max() <= high
            np.testing.assert_allclose(A @ t, w, atol=1e-9 * np.abs(w).max())
        told[inside] += 1
    assert min(told.values()) > 100, told


def test_the_least_norm_within_bounds_meets_the_conditions_of_optimality() -> None:
    """t = A^T y + mu - nu with multipliers of the active bounds that are not negative."""
    bound = 0
    for A, w, low, high in problems(300, 2):
        for wish in (0.0, 0.4 * (low + high)):
            try:
                t = bounded_distribution(A, w, low, high, wish)
            except TensionError:
                continue
            at_low, at_high = t <= low + 1e-9 * high, t >= high - 1e-9 * high
            free = ~(at_low | at_high)
            bound += not free.all()
            y = np.linalg.lstsq(A[:, free].T, (t - wish)[free], rcond=None)[0]
            gradient = (t - wish) - A.T @ y  # zero where free, signed at the bounds
            if free.sum() < 6:
                continue  # a vertex, where the multipliers are not unique
            assert np.abs(gradient[free]).max() < 1e-6 * high
            assert gradient[at_low].min(initial=0.0) > -1e-6 * high
            assert gradient[at_high].max(initial=0.0) < 1e-6 * high
    assert bound > 50


def test_values_are_those_of_a_second_solver() -> None:
    """SLSQP from inside, to 1e-6 of the norm."""
    compared = 0
    for A, w, low, high in problems(60, 3):
        margin = feasibility_margin(A, w, low, high)
        if margin.margin < 1e-3 * high:
            continue
        t = minimum_norm_within(A, w, low, high)
        found = minimize(
            lambda x, scale=high: 0.5 * (x @ x) / scale**2,
            margin.tension,
            jac=lambda x, scale=high: x / scale**2,
            bounds=[(low, high)] * len(t),
            constraints={
                "type": "eq",
                "fun": lambda x, A=A, w=w, scale=high: (A @ x - w) / scale,
                "jac": lambda x, A=A, scale=high: A / scale,
            },
            method="SLSQP",
            options={"ftol": 1e-15, "maxiter": 500},
        )
        assert np.linalg.norm(t) <= np.linalg.norm(found.x) * (1.0 + 1e-6)
        assert np.linalg.norm(t) >= np.linalg.norm(found.x) * (1.0 - 1e-6)
        compared += 1
    assert compared > 20


def test_the_barycentre_is_the_mean_of_what_is_feasible() -> None:
    """Against the mean of points drawn evenly in the null space, three standard errors."""
    draw = np.random.default_rng(4)
    for A, w, low, high in problems(40, 5):
        redundancy = A.shape[1] - 6
        if redundancy > 2:
            with pytest.raises(ValueError, match="not "):
                barycentre(A, w, low, high)
            continue
        if feasibility_margin(A, w, low, high).margin < 0.02 * high:
            continue
        centre = barycentre(A, w, low, high)
        np.testing.assert_allclose(A @ centre, w, atol=1e-8 * high)
        null = np.linalg.svd(A)[2][6:].T
        reach = np.linalg.norm(np.full(A.shape[1], high - low))
        points = centre + draw.uniform(-reach, reach, (200_000, redundancy)) @ null.T
        inside = points[((points >= low) & (points <= high)).all(axis=1)]
        error = inside.std(axis=0) / np.sqrt(len(inside))
        assert len(inside) > 50
        assert np.all(np.abs(inside.mean(axis=0) - centre) < 4.5 * error + 1e-9)


def test_a_wrench_that_no_cable_can_take_has_no_margin() -> None:
    A = np.vstack([np.eye(3), np.zeros((3, 3))])
    found = feasibility_margin(A, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 0.0, 10.0)
    assert found.margin == -np.inf and np.isnan(found.tension).all()


def test_bounds_may_be_equal_far_off_or_each_cable_s_own() -> None:
    seen = 0
    for A, w, low, high in problems(200, 6):
        k = A.shape[1]
        draw = np.random.default_rng(k)
        lower, upper = np.full(k, low), np.full(k, high)
        upper[draw.integers(k)] = 100.0 * high
        lower[draw.integers(k)] = -100.0 * high
        fixed = int(draw.integers(k))
        lower[fixed] = upper[fixed] = 0.5 * (low + high)
        inside = (
            linprog(np.zeros(k), A_eq=A, b_eq=w, bounds=np.stack([lower, upper], 1)).status == 0
        )
        try:
            t = bounded_distribution(A, w, lower, upper, high)
        except TensionError as error:
            assert not inside and "not decided" not in str(error)
            continue
        assert inside and np.all(t >= lower) and np.all(t <= upper)
        np.testing.assert_allclose(A @ t, w, atol=1e-9 * np.abs(w).max())
        # No feasible direction leads closer: the nearest point of the set as Clarabel finds it.
        closest = _by_clarabel(A, w, lower, upper, high)
        assert np.linalg.norm(t - high) <= np.linalg.norm(closest - high) * (1.0 + 1e-6)
        seen += 1
    assert seen > 40
    with pytest.raises(ValueError, match="finite"):
        bounded_distribution(A, w, low, np.inf, 0.0)


def _by_clarabel(
    A: np.ndarray, w: np.ndarray, lower: np.ndarray, upper: np.ndarray, wish: float
) -> np.ndarray:
    from pydrake.solvers import ClarabelSolver, MathematicalProgram

    programme, k = MathematicalProgram(), A.shape[1]
    t = programme.NewContinuousVariables(k)
    programme.AddLinearEqualityConstraint(A, w / wish, t)
    programme.AddBoundingBoxConstraint(lower / wish, upper / wish, t)
    programme.AddQuadraticErrorCost(np.eye(k), np.ones(k), t)
    return wish * ClarabelSolver().Solve(programme).GetSolution(t)
