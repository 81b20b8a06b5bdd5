"""Random cables of the classes that a solver of the elastic catenary finds easy or hard."""

from __future__ import annotations

import numpy as np

CLASSES = (
    "taut",
    "near-straight",
    "sagging",
    "near-vertical",
    "vertical",
    "vertical, end tension near 0",
    "horizontal",
)


def random_cables(name: str, count: int, generator: np.random.Generator) -> np.ndarray:
    """Rows (Bx, Bz, l0, w, EA) [m, m, m, N/m, N] of one class: L 1 to 150 m, w 0.1 to 50 N/m,
    EA 1e5 to 1e7 N.
    """

    def log_uniform(low: float, high: float) -> np.ndarray:
        return np.exp(generator.uniform(np.log(low), np.log(high), count))

    L, w, EA = log_uniform(1, 150), log_uniform(0.1, 50), log_uniform(1e5, 1e7)
    angle = generator.uniform(-np.pi / 2, np.pi / 2, count)
    Bx, Bz = np.maximum(L * np.cos(angle), 1e-3 * L), L * np.sin(angle)
    stretched = [
        1 / (1 + generator.uniform(0, 0.01, count)),
        1 + generator.choice([-1.0, 1.0], count) * log_uniform(1e-12, 1e-3),
        generator.uniform(1.0, 1.3, count),
    ]
    kind = generator.integers(0, 3, count)
    if name in CLASSES[:3]:
        kind = np.full(count, CLASSES.index(name))
    elif name == "horizontal":
        Bx, Bz = L, L * generator.choice([0.0, 1.0], count) * log_uniform(1e-12, 1e-2)
    else:
        Bx, Bz = log_uniform(1e-6, 0.1), generator.choice([-1.0, 1.0], count) * L
    if name == "vertical":
        Bx = np.full(count, 1e-6)
        stretched[0] = stretched[1] = generator.uniform(0.99, 1.3, count)
    L = np.hypot(Bx, Bz)
    l0 = L * np.choose(kind, stretched)
    if name == "vertical, end tension near 0":
        l0 = L * (1 + generator.uniform(-1, 1, count) * w * L / EA)
    return np.column_stack([Bx, Bz, l0, w, EA])
