"""The net of light that a moving surface throws on what lies below it."""

import numpy as np

from simulator.camera.trace_kernel import TILE, Light

_LENSES = 60
_FINEST, _COARSEST = 11, 4
"""Waves on a tile's side, which is 1.6 m."""
_FOCUS = 0.55


def caustic_net(seed: int) -> Light:
    """Return a tile of the net: of mean 0 and standard deviation 1, shape ``(256 * 256,)``.

    Waves that fit on the tile are so many lenses; light gathers where they bend towards each other.
    """
    rng = np.random.default_rng([seed, 5])
    at = 2.0 * np.pi * np.arange(TILE) / TILE
    bend = np.zeros((TILE, TILE))
    for _ in range(_LENSES):
        k, towards = rng.uniform(_COARSEST, _FINEST), rng.uniform(0.0, 2.0 * np.pi)
        m, n = round(k * np.cos(towards)), round(k * np.sin(towards))
        phase = rng.uniform(0.0, 2.0 * np.pi)
        bend += np.cos(m * at[:, None] + n * at[None, :] + phase)
    bend *= _FOCUS / bend.std()
    net = 1.0 / (0.35 + np.abs(1.0 - bend))
    net = (net - net.mean()) / net.std()
    return net.astype(np.float32).ravel()
