"""An independent, slow reference of the closed loop, straight from the paper: full history, full matrices, plain NumPy.

It shares only the scenario with the package, and the disturbance is an input. Where the package sums exponentials, this
integrates the true kernel against the whole history; where the package stores three entries of a symmetric matrix, this
lets the adaptation laws move all four.
"""

from __future__ import annotations

import math

import numpy as np
from fracgyro import Scenario
from scipy.linalg import expm
from scipy.special import gamma, roots_jacobi


def simulate(scenario: Scenario, disturbance: np.ndarray) -> dict[str, np.ndarray]:
    """Run `scenario` under `disturbance`, shape (samples, 2), its force over each step; returns histories.

    Sample n is at t = n h. Position and velocity are measured there, the force found from them is held until the next
    sample, and the estimates then advance by an Euler step. Options that the paper does not have (force limit, leakage,
    dead zone, projection) are not implemented.
    """
    c, a, h = scenario.controller, scenario.adaptation, scenario.run.step
    true_damping, true_stiffness, rate, more_damping, more_stiffness = scenario.plant.nondimensional()
    true_damping, true_stiffness = symmetric(true_damping), symmetric(true_stiffness)
    true_omega = np.array([[0.0, -rate], [rate, 0.0]])

    # Eq. (9), d and u held: [q, v, u + d] obeys a linear differential equation; its matrix exponential.
    flow = np.zeros((6, 6))
    flow[:2, 2:4] = flow[2:4, 4:] = np.eye(2)
    flow[2:4, :2] = -(true_stiffness + symmetric(more_stiffness))
    flow[2:4, 2:4] = -(true_damping + 2 * true_omega + symmetric(more_damping))
    advance = expm(h * flow)

    # Eqs (15), (16) and the surfaces they are compared with.
    alpha = c.order if c.kind.startswith("fractional") else 1.0
    lambda1 = np.array(c.fractional_gain)
    lambda2 = np.array(c.terminal_gain) * (c.kind in ("fractional_fast_terminal", "fast_terminal"))
    exponent = c.terminal_exponent

    ratio = a.initial_ratio if c.adaptive else 1.0
    damping, stiffness, omega = ratio * true_damping, ratio * true_stiffness, ratio * true_omega
    if a.initial_rate is not None and c.adaptive:
        omega = a.initial_rate * np.array([[0.0, -1.0], [1.0, 0.0]])
    squares = LeastSquares(damping, stiffness, omega, scenario) if a.kind == "composite" and c.adaptive else None
    bound = np.array(a.initial_bound)
    reference = scenario.reference
    amplitude, frequency, phase = map(np.array, (reference.amplitude, reference.frequency, reference.phase))
    q, v = np.array(scenario.run.initial_position), np.array(scenario.run.initial_velocity)

    samples = len(disturbance)
    fractional = FullHistory(alpha, h, samples)
    run = {name: np.empty((samples, 2)) for name in ("position", "velocity", "reference", "control")}
    run |= {name: np.empty((samples, 2)) for name in ("error", "error_rate", "surface")}
    run |= {name: np.empty((samples, 2, 2)) for name in ("damping", "stiffness", "omega")}
    run |= {"bound": np.empty((samples, 3)), "deviation": np.empty(samples), "trusted": np.empty(samples)}
    for n in range(samples):
        t = n * h
        angle = frequency * t + phase
        r = amplitude * np.sin(angle)
        e = q - r
        e_rate = v - amplitude * frequency * np.cos(angle)
        r_acceleration = -amplitude * frequency**2 * np.sin(angle)

        # Eq. (16); one history gives D^(alpha-1) e and the Caputo D^alpha e.
        run["error"][n], run["error_rate"][n] = e, e_rate
        integral, derivative = fractional(n, run["error"], run["error_rate"])
        if c.derivative == "riemann_liouville" and 0 < alpha < 1:
            grown = (t + h) ** (1 - alpha) - t ** (1 - alpha)
            derivative = derivative + run["error"][0] * grown / (h * math.gamma(2 - alpha))
        s = e_rate + lambda1 * integral + lambda2 * np.abs(e) ** exponent * np.sign(e)

        # Eqs (35), (36), (46); with known parameters (18), (19), (34).
        slope = exponent * np.maximum(np.abs(e), c.singularity_floor) ** (exponent - 1)
        reported = damping, stiffness, omega
        if squares:  # to which the laws add their own change
            run["deviation"][n], run["trusted"][n] = squares.quality()
            reported = squares.matrices(squares.start + squares.change)
            more = squares.matrices(squares.believed * squares.change)
            damping, stiffness, omega = damping + more[0], stiffness + more[1], omega + more[2]
        equivalent = (damping + 2 * omega) @ v + stiffness @ q + r_acceleration
        equivalent = equivalent - lambda1 * derivative - lambda2 * slope * e_rate
        most = c.switching_limit * c.layer_thickness / h if c.switching_limit < math.inf else math.inf
        rho = min(bound @ [1.0, norm(q), norm(v)], most)
        u = equivalent - rho * switching(s, c.layer_thickness, c.layer)
        if c.feedforward == "held":  # the reference moves from here to the middle of the hold
            held = np.exp(1j * (angle + frequency * h / 2)) * amplitude / np.sinc(frequency * h / (2 * np.pi))
            way, way_rate = held.imag - r, frequency * held.real - amplitude * frequency * np.cos(angle)
            u = u + (damping + 2 * omega) @ way_rate + stiffness @ way - frequency**2 * held.imag - r_acceleration

        run["position"][n], run["velocity"][n], run["reference"][n] = q, v, r
        run["surface"][n], run["control"][n] = s, u
        run["damping"][n], run["stiffness"][n], run["omega"][n] = reported
        run["bound"][n] = bound
        if squares:
            damping, stiffness, omega = damping - more[0], stiffness - more[1], omega - more[2]
            squares.sample(q, v, u)

        # Eq. (44), which gives the derivatives of the transposes.
        if c.adaptive:
            vs, qs = np.outer(v, s), np.outer(q, s)
            swirl = vs + vs.T if c.rate_law == "printed" else vs - vs.T
            damping = damping - h * 0.5 * a.damping_gain * (vs + vs.T).T
            stiffness = stiffness - h * 0.5 * a.stiffness_gain * (qs + qs.T).T
            omega = omega - h * a.rate_gain * swirl.T
            grown = bound + h * np.array(a.bound_gain) * norm(s) * [1.0, norm(q), norm(v)]
            bound = np.maximum(bound, np.minimum(grown, most))

        q, v = np.split((advance @ np.concatenate([q, v, u + disturbance[n]]))[:4], 2)
    return run


class LeastSquares:
    """Composite adaptation's least squares, by inverting the whole information matrix at every step.

    Eq. (9) over one step with the hold modeled: residuals a - u + (D + 2 Omega) v + K q of the mean acceleration,
    velocity and position; rows of the mean velocity minus the part caused by the disturbance.
    """

    prior = 1e4

    def __init__(self, damping: np.ndarray, stiffness: np.ndarray, omega: np.ndarray, scenario: Scenario) -> None:
        upper = [0, 0, 1], [0, 1, 1]
        self.start = np.array([omega[1, 0], *damping[upper], *stiffness[upper]])
        self.change = np.zeros(7)
        self.information = np.eye(7) / self.prior
        self.squares = self.draws = 0.0
        self.left = np.zeros(2)
        self.believed = False  # from when the rate is first trusted, for good
        self.h = scenario.run.step
        self.forgetting = scenario.adaptation.forgetting
        self.rate_forgetting = scenario.adaptation.rate_forgetting
        self.largest_deviation = 0.01 * math.sqrt(np.trace(stiffness) / 2)
        self.last: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        # Means of r^2/S, r g/S and g^2/S, and of the explained part; an error of the rate adds g to r.
        self.window = min(max(4 * 2 * math.pi / (100 * self.largest_deviation) / self.h, 16), 65536)
        self.normalized, self.along, self.sensitivity, self.explained = 1.0, 0.0, 0.0, 0.0
        self.consistent = True

    @staticmethod
    def matrices(entries: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return symmetric(entries[1:4]), symmetric(entries[4:]), entries[0] * np.array([[0.0, -1.0], [1.0, 0.0]])

    def quality(self) -> tuple[float, bool]:
        variance = np.linalg.inv(self.information)[0, 0]
        noise = self.squares / self.draws if self.draws else 0.0
        trusted = variance * self.information[0, 0] <= 10 and variance <= 0.01 * self.prior
        trusted = trusted and math.sqrt(noise * variance) <= self.largest_deviation
        excess = self.normalized - self.explained_now()
        lag = max(self.explained_now() - 4 / self.window, self.explained - 0.75 / self.window, 0)
        lag_variance = 2 * lag / self.sensitivity if lag else 0.0
        return math.sqrt(noise * variance * max(excess, 1) + lag_variance), trusted and self.consistent

    def explained_now(self) -> float:
        return self.along**2 / self.sensitivity / 2 if self.sensitivity else 0.0

    def judge(self, residual: np.ndarray, v: np.ndarray) -> None:
        """Valid only while no sample is refused."""
        precision = self.believed * self.left * self.draws / self.squares if self.squares else np.zeros(2)
        g = np.array([-2 * v[1], 2 * v[0]])
        self.normalized += (precision @ residual**2 / 2 - self.normalized) / self.window
        self.along += (precision @ (g * residual) - self.along) / self.window
        self.sensitivity += (precision @ g**2 - self.sensitivity) / self.window
        self.explained += (self.explained_now() - self.explained) / (2 * self.window)
        self.consistent = self.normalized - self.explained_now() <= 1.25 + 3 * self.explained

    def sample(self, q: np.ndarray, v: np.ndarray, u: np.ndarray) -> None:
        if self.last is not None:
            self.forget()
            self.learn(*self.last, q, v)
            self.believed = self.believed or self.quality()[1]
        self.last = q, v, u

    def forget(self) -> None:
        covariance = np.linalg.inv(self.information)
        growth = self.h * self.forgetting * max(0.0, 1 - np.trace(covariance) / (7 * self.prior))
        covariance *= 1 + growth
        self.squares /= 1 + growth
        self.draws /= 1 + growth
        p = covariance[0, 0]
        covariance[0, 0] += self.h * self.rate_forgetting * max(0.0, 1 - p / self.prior) * p
        self.information = np.linalg.inv(covariance)

    def learn(self, q0: np.ndarray, v0: np.ndarray, u: np.ndarray, q1: np.ndarray, v1: np.ndarray) -> None:
        h = self.h
        mean_v, mean_q = (q1 - q0) / h, (q0 + q1) / 2 + h / 12 * (v0 - v1)
        damping, stiffness, omega = self.matrices(self.start + self.change)
        residual = (v1 - v0) / h - u + (damping + 2 * omega) @ mean_v + stiffness @ mean_q
        self.judge(residual, mean_v)
        x, y = mean_v - h / 2 * self.believed * self.left * residual
        rows = np.array([[-2 * y, x, y, 0, *mean_q, 0], [2 * x, 0, x, y, 0, *mean_q]])
        found = self.change.copy()
        for axis in (0, 1):
            r = residual[axis] + rows[axis] @ (self.change - found)
            self.left[axis] = 1 / (1 + rows[axis] @ np.linalg.solve(self.information, rows[axis]))
            self.information = self.information + np.outer(rows[axis], rows[axis])
            self.change = self.change - np.linalg.solve(self.information, rows[axis]) * r
            self.draws += self.left[axis]
            self.squares += (self.left[axis] * r) ** 2


def symmetric(entries: np.ndarray) -> np.ndarray:
    xx, xy, yy = entries
    return np.array([[xx, xy], [xy, yy]])


def norm(vector: np.ndarray) -> float:
    return math.hypot(vector[0], vector[1])


def switching(s: np.ndarray, thickness: float, layer: str) -> np.ndarray:
    """Factor of -rho: eq. (20) outside the layer, (33) or its linear reading inside."""
    size = norm(s)
    if size >= thickness:
        return s / size if size > 0 else s
    return s / thickness if layer == "linear" else s * size / thickness**2


class FullHistory:
    """I^(1-alpha) e and I^(1-alpha) de/dt at every sample, e being a cubic Hermite interpolant.

    With nu = 1 - alpha, x in [0, 1] along an interval that begins m steps ago, and its Hermite basis H,

        I^nu e = 1/Gamma(nu) integral_0^t (t - tau)^(nu-1) e(tau) dtau
               = sum over m of h^nu/Gamma(nu) integral_0^1 (m - x)^(nu-1) H(x) dx . [e, h de/dt at both ends],

    and the same for de/dt with H'/h instead of H. The newest interval, m = 1, has the kernel's singularity at
    x = 1, which Gauss-Jacobi quadrature handles; the others are smooth and use Gauss-Legendre.
    """

    def __init__(self, alpha: float, h: float, samples: int) -> None:
        self.alpha = alpha
        if alpha == 1:
            return
        m = np.arange(1, samples + 1)
        ends = np.empty((samples, 2, 4))  # [m, I^nu e or I^nu de/dt, weight of each entry of H]
        for intervals, jacobi in ((m[:1], -alpha), (m[1:], 0.0)):
            nodes, weights = roots_jacobi(20, jacobi, 0.0)
            x, weights = (1 + nodes) / 2, weights / 2 ** (1 + jacobi)
            # 1 - x cancels near x = 1, but for m = 1 the weight function is the whole kernel.
            kernel = np.ones((1, 20)) if jacobi else (intervals[:, None] - x) ** -alpha
            basis = np.array([hermite_basis(x), hermite_basis_slope(x) / h])
            ends[intervals - 1] = np.einsum("mx,x,oix->moi", kernel, weights, basis)
        ends *= h ** (1 - alpha) / gamma(1 - alpha)
        ends[:, :, 2:] *= h
        left, right = ends[:, :, 0::2], ends[:, :, 1::2]
        # The sample k steps ago ends the interval that began k + 1 ago, and begins the one that began k ago.
        by_lag = right.copy()
        by_lag[1:] += left[:-1]
        # Rows run from the oldest sample to the newest, as the history does.
        self.weights = np.ascontiguousarray(by_lag[::-1].transpose(2, 1, 0))
        self.right = right

    def __call__(self, n: int, e: np.ndarray, e_rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self.alpha == 1:
            return e[n], e_rate[n]
        of_e, of_rate = self.weights[:, :, -(n + 1) :]
        result = of_e @ e[: n + 1] + of_rate @ e_rate[: n + 1]
        # No interval ends at the first sample.
        result -= np.outer(self.right[n, :, 0], e[0]) + np.outer(self.right[n, :, 1], e_rate[0])
        # D^0 e = e, as eq. (7) has it; I^1 de/dt would be e - e(0).
        return result[0], e[n] if self.alpha == 0 else result[1]


def hermite_basis(x: np.ndarray) -> np.ndarray:
    """Basis for [left value, right value, left slope, right slope]."""
    left, right = (1 + 2 * x) * (1 - x) ** 2, x**2 * (3 - 2 * x)
    return np.array([left, right, x * (1 - x) ** 2, x**2 * (x - 1)])


def hermite_basis_slope(x: np.ndarray) -> np.ndarray:
    return np.array([6 * x * (x - 1), 6 * x * (1 - x), (1 - x) * (1 - 3 * x), x * (3 * x - 2)])
