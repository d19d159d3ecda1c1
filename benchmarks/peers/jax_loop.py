"""The closed loop in JAX, double precision: `lax.scan` for one run, and the same under `vmap` for many.

Tried and kept: states packed into few arrays, and one small matrix product for the exponentials; a carry of many
scalars is two to four times slower, and so are sums written out. Tried, no faster: unrolling, the batch last.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .exponentials import operator
from .gyroscope import ESTIMATES, ORDER, START, STEP, held_step, make_law, references, row

jax.config.update("jax_enable_x64", True)


def _loop(count: int, rates: np.ndarray, weights: np.ndarray) -> tuple[Callable[..., Any], Any, Any]:
    """body(state, (noise, others)) -> (state, position, error); its first state; the others, prepared."""
    law = make_law(jnp.sqrt, jnp.where, jnp.copysign)
    designed = operator(ORDER, STEP, count, rates, weights)
    decay, readout = designed.decay[:, None], designed.weights
    reference = references(STEP * np.arange(count))
    start = np.array(START) - reference[0, :4]
    step = held_step(STEP)

    def body(state, noise, others):
        q, estimates, past, g = state
        r, onset = others
        x, y, v_x, v_y = q
        f = q - r[:4]
        i_x, i_y, d_x, d_y = designed.newest * f + designed.past * past + readout @ g
        derivative = (d_x + start[0] * onset, d_y + start[1] * onset)
        _, u, slopes = law(
            (x, y), (v_x, v_y), (f[0], f[1]), (f[2], f[3]), (r[4], r[5]), (i_x, i_y), derivative, tuple(estimates)
        )
        f_x, f_y = u[0] + noise[0], u[1] + noise[1]
        moved = jnp.stack([row(m, x, y, v_x, v_y, f_x, f_y) for m in step])
        return (moved, estimates + STEP * jnp.stack(slopes), f, decay * g + past), q[:2], f[:2]

    first = (np.array(START), np.array(ESTIMATES), designed.before * start, np.outer(designed.start, start))
    return body, tuple(map(jnp.asarray, first)), (jnp.asarray(reference), jnp.asarray(designed.onset))


def make_scan(count: int, rates: np.ndarray, weights: np.ndarray) -> Callable[[jax.Array], jax.Array]:
    """Noise (count, 2) to positions (count, 2)."""
    body, first, others = _loop(count, rates, weights)

    @jax.jit
    def run(noise: jax.Array) -> jax.Array:
        def scanned(state, inputs):
            state, position, _ = body(state, *inputs)
            return state, position

        return jax.lax.scan(scanned, first, (noise, others))[1]

    return run


def make_batch(
    count: int, rates: np.ndarray, weights: np.ndarray, transient: float
) -> Callable[[jax.Array], jax.Array]:
    """Noise (runs, count, 2) to RMSE (runs, whole and steady, 2); no trajectory is kept."""
    body, first, others = _loop(count, rates, weights)
    steady = jnp.asarray(STEP * np.arange(count) >= transient - 0.5 * STEP)
    samples = jnp.array([count, jnp.sum(steady)])[:, None]

    def one(noise: jax.Array) -> jax.Array:
        def scanned(carry, inputs):
            state, whole, late = carry
            noise, others, is_steady = inputs
            state, _, error = body(state, noise, others)
            squares = error * error
            return (state, whole + squares, late + jnp.where(is_steady, squares, 0.0)), None

        zero = jnp.zeros(2)
        (_, whole, late), _ = jax.lax.scan(scanned, (first, zero, zero), (noise, others, steady))
        return jnp.sqrt(jnp.stack([whole, late]) / samples)

    return jax.jit(jax.vmap(one))
