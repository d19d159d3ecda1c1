"""Controllers again, in NumPy, from their equations: called with a sample of fg.simulate, they return the force. They
share only the scenario with the package.
"""

from __future__ import annotations

import fracgyro as fg
import numpy as np
from reference_oracle import motion


def held_points(scenario: fg.Scenario) -> np.ndarray:
    """The reference at the held point of every step."""
    h = scenario.run.step
    return motion(scenario, h * np.arange(scenario.run.steps + 1), h)


def nominal(scenario: fg.Scenario) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """D, 2 Omega and K of the nominal plant."""
    damping, stiffness, rate, _, _ = scenario.plant.nondimensional()
    ratio = scenario.adaptation.initial_ratio if scenario.controller.adaptive else 1.0  # then all is known
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    d, k = (ratio * np.array([entries[:2], entries[1:]]) for entries in (damping, stiffness))
    return d, 2 * ratio * rate * turn, k


class Resonant:
    """The law in a fixed frame: a and b multiply cos wt and sin wt, which the core never computes."""

    def __init__(self, frequencies: list[float]) -> None:
        self.w = np.array(frequencies)

    def reset(self, scenario: fg.Scenario) -> None:
        self.scenario, c, h = scenario, scenario.controller, scenario.run.step
        self.held = held_points(scenario)
        self.square, self.damper = c.natural_frequency**2, 2 * c.damping_ratio * c.natural_frequency
        self.integral_step = h * c.integral_frequency * self.square
        self.damping, self.coriolis, self.stiffness = nominal(scenario)
        # Residues of Π ((s + k/2)² + w²)/(s² + w²) at s = jw, by polynomials.
        k = c.resonator_gain
        poles = [root for w in self.w for root in (1j * w, -1j * w)]
        zeros = [pole - k / 2 for pole in poles]
        residues = [
            np.prod([1j * w - zero for zero in zeros]) / np.prod([1j * w - pole for pole in poles if pole != 1j * w])
            for w in self.w
        ]
        s = 1j * self.w[:, None]
        loop = s**2 + (self.damper + np.diag(self.damping)) * s + self.square + np.diag(self.stiffness)
        loop = loop + c.integral_frequency * self.square / s if len(self.w) else loop
        self.gain = 2 * h * np.reshape(residues, (-1, 1)) * loop * np.exp(0.5j * self.w[:, None] * h)
        self.a, self.b, self.integral = np.zeros(loop.shape), np.zeros(loop.shape), np.zeros(2)
        self.limit, self.reached = c.force_limit, 0

    def __call__(self, s: fg.Sample) -> np.ndarray:
        r, v = np.array(s.reference), np.array(s.reference_velocity)
        e, de = np.array(s.position) - r, np.array(s.velocity) - v
        position, velocity, acceleration = self.held[:, round(s.time / self.scenario.run.step)]
        cosine, sine = np.cos(self.w * s.time)[:, None], np.sin(self.w * s.time)[:, None]
        force = (self.damping + self.coriolis) @ velocity + self.stiffness @ position + acceleration
        force = force - self.square * e - self.damper * de - self.integral - (self.a * cosine + self.b * sine).sum(0)
        allowed = np.clip(force, -self.limit, self.limit)
        self.reached += bool(np.any(allowed != force))
        if (force - allowed) @ e >= 0.0:
            # Re(p) of p' = jw p + g e, with p = (a - jb) e^(jwt).
            turned = self.gain * (cosine - 1j * sine) * e
            self.a, self.b = self.a + turned.real, self.b - turned.imag
            self.integral = self.integral + self.integral_step * e
        return np.asarray(allowed)


class IntegralSliding:
    """The observer as zeta' = -L (d + u - f0), d = zeta + l v, with the exact gains of a held force."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h = scenario.controller, scenario.run.step
        self.held = held_points(scenario)
        self.damping, self.coriolis, self.stiffness = nominal(scenario)
        self.share = 1 - np.exp(-self.c.disturbance_observer * self.h)
        self.zeta, self.integral, self.reached = None, np.zeros(2), 0

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c, h = self.c, self.h
        e = np.array(s.position) - np.array(s.reference)
        de = np.array(s.velocity) - np.array(s.reference_velocity)
        if self.zeta is None:
            self.zeta = -self.share / h * de
        d = self.zeta + self.share / h * de
        position, velocity, acceleration = self.held[:, round(s.time / h)]
        keeps = (self.damping + self.coriolis) @ (velocity + de) + self.stiffness @ (position + e) + acceleration
        surface = de + c.surface_gain * e
        wanted = keeps - c.surface_gain * de - c.reaching_rate * surface - self.integral - d
        force = np.clip(wanted, -c.force_limit, c.force_limit)
        self.reached += bool(np.any(force != wanted))
        if (wanted - force) @ surface >= 0:
            self.integral = self.integral + h * c.integral_rate * c.reaching_rate * surface
        self.zeta = self.zeta - self.share * (d + force - keeps)
        return np.asarray(force)


class Pid:
    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h = scenario.controller, scenario.run.step
        self.held = held_points(scenario)
        self.damping, self.coriolis, self.stiffness = nominal(scenario)
        self.integral = np.zeros(2)

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c = self.c
        position, velocity, acceleration = self.held[:, round(s.time / self.h)]
        e = np.array(s.position) - np.array(s.reference)
        de = np.array(s.velocity) - np.array(s.reference_velocity)
        along = (self.damping + self.coriolis) @ velocity + self.stiffness @ position + acceleration
        square, damper = c.natural_frequency**2, 2 * c.damping_ratio * c.natural_frequency
        wanted = along - square * e - damper * de - self.integral
        force = np.clip(wanted, -c.force_limit, c.force_limit)
        if (wanted - force) @ e >= 0:
            self.integral = self.integral + self.h * c.integral_frequency * square * e
        return np.asarray(force)


class Laws:
    """The estimated plant, which the laws (44) move."""

    def __init__(self, scenario: fg.Scenario) -> None:
        self.gains, self.h = scenario.adaptation, scenario.run.step
        self.damping, self.coriolis, self.stiffness = nominal(scenario)
        self.adaptive = scenario.controller.adaptive

    def force(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        return np.asarray((self.damping + self.coriolis) @ velocity + self.stiffness @ position)

    def learn(self, position: np.ndarray, velocity: np.ndarray, s: np.ndarray) -> None:
        if self.adaptive:
            turn = np.array([[0.0, -1.0], [1.0, 0.0]])
            moves, holds = np.outer(velocity, s), np.outer(position, s)
            self.damping = self.damping - self.h * self.gains.damping_gain / 2 * (moves + moves.T)
            self.stiffness = self.stiffness - self.h * self.gains.stiffness_gain / 2 * (holds + holds.T)
            self.coriolis = self.coriolis + 2 * self.h * self.gains.rate_gain * (moves[1, 0] - moves[0, 1]) * turn


class Backstepping:
    """The kind `linear` with all its options, for a known plant, as backstepping is written: z2 = v - alpha."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h = scenario.controller, scenario.run.step
        self.plant, self.bound = Laws(scenario), np.array(scenario.adaptation.initial_bound)
        self.integral, self.asked, self.offset, self.reached = np.zeros(2), None, np.zeros(2), 0

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c, h = self.c, self.h
        q, v, r = np.array(s.position), np.array(s.velocity), np.array(s.reference)
        z1, de = q - r, v - np.array(s.reference_velocity)
        asks = np.array(s.reference_velocity) - c.fractional_gain * z1 - c.error_integral * self.integral
        moves = np.array(s.reference_acceleration) - c.fractional_gain * de - c.error_integral * z1
        if self.asked is None:
            self.asked = asks
            self.offset = v - asks if c.start_rate > 0 else self.offset
        follows = 1 - np.exp(-h / c.surface_filter) if c.surface_filter > 0 else 1.0
        alpha = asks
        if c.surface_filter > 0:
            alpha, moves = self.asked, follows / h * (asks - self.asked)
        decays = 1 - np.exp(-c.start_rate * h)
        z2 = v - alpha - self.offset
        moves = moves - decays / h * self.offset
        rho = self.bound @ [1, np.linalg.norm(q), np.linalg.norm(v)]
        switching = rho * z2 / max(np.linalg.norm(z2), c.layer_thickness)
        wanted = self.plant.force(q, v) + moves - c.coupling * z1 - switching
        force = np.clip(wanted, -c.force_limit, c.force_limit)
        self.reached += bool(np.any(force != wanted))
        self.asked = self.asked + follows * (asks - self.asked)
        self.offset = self.offset - decays * self.offset
        if (wanted - force) @ z1 >= 0:
            self.integral = self.integral + h * z1
        return np.asarray(force)


class DynamicSliding:
    """The force of a step from sigma at its end, which the reaching law gives."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h = scenario.controller, scenario.run.step
        self.held, self.laws = held_points(scenario), Laws(scenario)
        self.force, self.reached = np.zeros(2), 0

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c, h, laws = self.c, self.h, self.laws
        q, v = np.array(s.position), np.array(s.velocity)
        e, de = q - np.array(s.reference), v - np.array(s.reference_velocity)
        position, velocity, acceleration = self.held[:, round(s.time / h)]
        along = laws.force(position, velocity) + acceleration
        damper, spring = c.surface_gain + c.reaching_rate, c.surface_gain * c.reaching_rate
        before = self.force - laws.force(e, de)
        sigma = before + damper * de + spring * e
        keeps = np.exp(-c.force_bandwidth * h)
        switches = keeps * (1 - np.exp(-c.switching_rate * h / c.switching_layer)) * sigma
        left = keeps * sigma - np.clip(switches, -c.switching_rate * h, c.switching_rate * h)
        # The acceleration a of the coming step: w - f+ + damper (de + h a) + spring (e + h de + h^2/2 a) = left, with
        # w = a + f and the force f+ of the plant at the end by the acceleration before.
        grows = laws.force(h * de + h * h / 2 * before, h * before)
        now = (left + grows - damper * de - spring * (e + h * de)) / (1 + h * damper + h * h / 2 * spring)
        wanted = along + now + laws.force(e, de)
        force = np.clip(wanted, -c.force_limit, c.force_limit)
        self.reached += bool(np.any(force != wanted))
        self.force = force - along
        if (wanted - force) @ sigma >= 0:
            laws.learn(q, v, de + c.surface_gain * e)
        return np.asarray(force)


class FixedTime:
    """The held reaching step by its root in sqrt|s|."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h = scenario.controller, scenario.run.step
        self.held, self.laws = held_points(scenario), Laws(scenario)
        self.reached = 0

    def taken(self, size: float) -> float:
        """The rate at which |s| falls in a step."""
        c, h, root = self.c, self.h, np.sqrt(size)
        if c.reaching == "explicit":
            return float(c.near_reaching * root + c.far_reaching * root**3)
        roots = np.roots([h / 2 * c.far_reaching, 1.0, h / 2 * c.near_reaching - root])
        return float((size - max(roots.max(), 0.0) ** 2) / h)

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c, laws = self.c, self.laws
        q, v, r, dr = (np.array(x) for x in (s.position, s.velocity, s.reference, s.reference_velocity))
        e, de = q - r, v - dr
        position, velocity, acceleration = self.held[:, round(s.time / self.h)]
        size = np.maximum(np.abs(e), c.near_floor)
        surface = de + np.sign(e) * (
            c.near_gain * np.abs(e) ** c.near_exponent + c.far_gain * np.abs(e) ** c.far_exponent
        )
        slope = c.near_gain * c.near_exponent * size ** (c.near_exponent - 1)
        slope = slope + c.far_gain * c.far_exponent * np.abs(e) ** (c.far_exponent - 1)
        reach = np.sign(surface) * [self.taken(abs(one)) for one in surface]
        wanted = laws.force(q + position - r, v + velocity - dr) + acceleration - slope * de - reach
        force = np.clip(wanted, -c.force_limit, c.force_limit)
        self.reached += bool(np.any(force != wanted))
        if (wanted - force) @ surface >= 0:
            laws.learn(q, v, surface)
        return np.asarray(force)


class Prescribed:
    """The derivative of the velocity that it follows by a difference, and the bound in closed form."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h = scenario.controller, scenario.run.step
        self.held, self.laws = held_points(scenario), Laws(scenario)
        self.xi = max(self.c.barrier_scale, 2 * self.h / self.c.bound_final)
        self.reached, self.widened = 0, 0

    def epsilon(self, e: np.ndarray, rho: np.ndarray, course: np.ndarray) -> np.ndarray:
        return np.asarray(np.arctanh(np.clip(e / rho, -1 + 2**-10, 1 - 2**-10)) / (self.xi * course / rho))

    def follows(self, e: np.ndarray, rho: np.ndarray, course: np.ndarray) -> np.ndarray:
        """alpha less the velocity of the reference."""
        c, epsilon = self.c, self.epsilon(e, rho, course)
        phi = 2**-0.75 * c.barrier_root * np.sign(epsilon) * np.sqrt(np.abs(epsilon)) + c.barrier_cube / 4 * epsilon**3
        barrier = self.xi * course * (1 - (e / rho) ** 2)
        return np.asarray(-c.bound_rate * (1 - c.bound_final / rho) * e - barrier * phi)

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c, laws, h = self.c, self.laws, self.h
        q, v, r, dr = (np.array(x) for x in (s.position, s.velocity, s.reference, s.reference_velocity))
        e, de, n = q - r, v - dr, round(s.time / h)
        if n == 0:
            self.first = self.rho = np.maximum(1.2 * np.abs(e), c.bound_start)
        course = c.bound_final + (self.first - c.bound_final) * np.exp(-c.bound_rate * s.time)
        self.rho = np.where(np.abs(e) > (1 - 2**-10) * self.rho, 1.2 * np.abs(e), self.rho)
        self.widened += bool(np.any(self.rho > 1.01 * course))
        if c.barrier_shape == "funnel":
            z = de + c.bound_rate * (1 - c.bound_final / self.rho) * e
            gain = np.minimum(1 / (self.xi * course * np.maximum(1 - np.abs(e) / self.rho, 2**-10)), 0.5 / h)
            last = c.damper * c.velocity_bound * c.bound_final
            push = -(gain**2) * e - last * de / np.maximum(c.velocity_bound * self.rho - np.abs(de), 1.25 * h * last)
        else:
            z, push = self.barrier(e, de, course)
        position, velocity, acceleration = self.held[:, n]
        wanted = laws.force(q + position - r, v + velocity - dr) + acceleration + push
        force = np.clip(wanted, -c.force_limit, c.force_limit)
        self.reached += bool(np.any(force != wanted))
        self.rho = c.bound_final + np.exp(-c.bound_rate * h) * (self.rho - c.bound_final)
        self.rho = np.where(force != wanted, np.maximum(self.rho, 1.2 * np.abs(e)), self.rho)
        if (wanted - force) @ z >= 0:
            laws.learn(q, v, z)
        return np.asarray(force)

    def barrier(self, e: np.ndarray, de: np.ndarray, course: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """z, and the force without that of the plant and the reference."""
        c, h = self.c, self.h
        fall = -c.bound_rate * (self.rho - c.bound_final), -c.bound_rate * (course - c.bound_final)
        small = 1e-7
        ends = [self.follows(e + t * de, self.rho + t * fall[0], course + t * fall[1]) for t in (-small, small)]
        z = de - self.follows(e, self.rho, course)
        barrier = np.maximum(self.xi * course * (1 - (e / self.rho) ** 2), 2 * h)
        damps = (
            c.damper * np.abs(z) + 2**-0.75 * c.damper_root * np.sqrt(np.abs(z)) + c.damper_cube / 4 * np.abs(z) ** 3
        )
        turns = (ends[1] - ends[0]) / (2 * small) - self.epsilon(e, self.rho, course) / barrier
        return z, np.asarray(turns - np.sign(z) * np.minimum(damps, np.abs(z) / h))


class Network:
    """The basis functions of the paper's reference, whose amplitudes are 1: positions, then velocities."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h = scenario.controller, scenario.run.step
        self.held = held_points(scenario)
        self.damping, self.coriolis, self.stiffness = nominal(scenario)
        reference = scenario.reference
        self.frequency, self.phase = np.array(reference.frequency), np.array(reference.phase)
        nodes, period = int(self.c.nodes), 2 * np.pi / self.frequency.min()
        self.centers = self.orbit(np.arange(nodes) / nodes * period)
        if self.c.layout == "diagonal":
            self.centers = np.linspace(-1, 1, nodes)[:, None] * np.ones(4)
        self.seen = np.ones((nodes, 4))  # inputs of each node
        if self.c.basis == "membership":
            self.centers = np.repeat(np.linspace(-1, 1, nodes // 4), 4)[:, None] * np.ones(4)
            self.seen = np.tile(np.eye(4), (nodes // 4, 1))
        self.places, self.widths = self.centers.copy(), np.full(len(self.centers), self.c.node_width)
        self.last, self.force = np.zeros(1), np.zeros(2)
        on_orbit = [self.phi(x) for x in self.orbit(np.arange(256) / 256 * period)]
        self.largest = max(phi @ phi for phi in on_orbit)
        self.rate = self.h * min(self.c.learning_frequency**2, 0.9 * self.c.reaching_rate / self.h)
        self.weights, self.theta, self.reached = np.zeros((len(on_orbit[0]), 2)), 0.0, 0
        self.last = np.zeros(len(on_orbit[0]))
        follows = (1 - np.exp(-self.h * self.c.prediction_rate)) / self.h
        most = max(follows * (0.9 / self.rate - 1 / self.c.reaching_rate), 0.0)
        self.weight, self.model = 0.0 if self.c.minimal else min(self.c.prediction_weight, most), None

    def orbit(self, time: np.ndarray) -> np.ndarray:
        angle = self.frequency * time[:, None] + self.phase
        return np.concatenate([np.sin(angle), np.cos(angle)], axis=1)

    def phi(self, x: np.ndarray) -> np.ndarray:
        if self.c.basis in ("gaussian", "membership"):
            phi = np.exp(-self.squares(x) / (2 * self.widths**2))
            return np.asarray(phi / max(phi.sum(), 1e-12) if self.c.normalized else phi)
        if self.c.basis == "chebyshev":
            angle = np.arccos(np.clip(x, -1, 1))
            return np.concatenate([[1.0], *(np.cos(k * angle) for k in range(1, int(self.c.polynomial_degree) + 1))])
        return np.array([1.0, *x] if self.c.basis == "linear" else [1.0])

    def squares(self, x: np.ndarray) -> np.ndarray:
        self.away = x - self.centers + self.c.inner_loop * self.last[:, None]
        return np.asarray((self.away**2 * self.seen).sum(axis=1))

    def move(self, x: np.ndarray, phi: np.ndarray, learns: np.ndarray) -> None:
        c, b = self.c, self.widths
        pull = -self.h * (self.weights @ learns) * phi / b**2
        self.widths = np.clip(b + c.width_rate * pull * self.squares(x) / b, min(c.node_width, 0.05), 10.0)
        moved = self.centers - self.places + c.center_rate * pull[:, None] * self.away
        self.centers = self.places + np.clip(moved, -1, 1)

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c, h = self.c, self.h
        e = np.array(s.position) - np.array(s.reference)
        de = np.array(s.velocity) - np.array(s.reference_velocity)
        position, velocity, acceleration = self.held[:, round(s.time / h)]
        q, v = position + e, velocity + de
        surface = de + c.surface_gain * e
        seen = (position, velocity) if c.network_inputs == "reference" else (q, v)
        fed_back = c.outer_loop * np.clip(self.force / self.frequency**2, -1, 1)
        x = np.concatenate([seen[0] + fed_back, seen[1] / self.frequency])
        phi = (1 - c.gate) * self.phi(x) + c.gate * self.last
        share = min(phi @ phi / self.largest, 1.0)
        learned = -self.theta * share / 2 * surface if c.minimal else phi @ self.weights
        model = (self.damping + self.coriolis) @ v + self.stiffness @ q if c.model else 0.0
        switching = c.switching_force * np.clip(surface / c.surface_layer, -1, 1)
        wanted = model + acceleration - c.surface_gain * de - c.reaching_rate * surface - switching + learned
        force = np.clip(wanted, -c.force_limit, c.force_limit)
        self.reached += bool(np.any(force != wanted))
        active, norm = float((wanted - force) @ surface >= 0), np.linalg.norm(surface)
        self.theta = self.theta * np.exp(-h * c.weight_leak) + active * self.rate * share * norm**2 / 2
        self.theta = min(self.theta, 2 * (0.8 / h - c.reaching_rate))
        keep = np.exp(-h * (c.weight_leak + c.error_leak * norm))
        missed = np.zeros(2) if self.model is None else de - self.model
        # z decays by beta, and the acceleration under the acting force is what the network makes of it.
        self.model = de - np.exp(-h * c.prediction_rate) * missed + h * (force - model - acceleration - learned)
        learns = active * surface + self.weight * missed
        if c.center_rate > 0 or c.width_rate > 0:
            self.move(x, phi, learns)
        self.last, self.force = phi, learned
        self.weights = keep * self.weights - self.rate / max(phi @ phi, self.largest) * np.outer(phi, learns)
        return np.asarray(force)


class Line:
    """Whole angle and virtual rotation in complex numbers, with phase and angle as plain floats."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h, self.w = scenario.controller, scenario.run.step, scenario.reference.frequency[0]
        self.size, self.reverses = scenario.reference.amplitude[0], scenario.controller.kind == "virtual_rotation"
        self.theta, self.angle = scenario.reference.phase[0], self.c.start_angle
        self.z = np.zeros(2, complex)
        self.detuning = self.offset = self.force = self.turning = self.sum = self.held = self.wait = 0.0
        self.out = np.zeros(3)  # rate, quadrature, decay, behind the filter of the output
        self.way, self.steps, self.last = 0.0, 0, 0.0
        self.sign, self.ways, self.mean, self.scale_error = 1.0, 0, 0.0, 0.0
        self.reports: list[dict[str, float]] = []

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c, h = self.c, self.h
        p = np.exp(1j * self.angle)
        along, across = np.array([p.real, p.imag]), np.array([-p.imag, p.real])
        self.keep(along @ self.z)
        turn = np.exp(1j * self.theta)
        missed = np.array(s.position) - (self.z * turn).real
        self.z = self.z + 2 * c.demodulation_bandwidth * h * missed / turn
        u, v = along @ self.z, across @ self.z
        rate, wanted_rate = self.follow(u, v), self.sign * c.virtual_rate
        drive, frequency = self.drive(u)
        before, self.theta = self.theta, self.theta + frequency * h
        self.sum += v.real
        half_over = np.cos(before) * np.cos(self.theta) < 0
        mean = self.sum * h * self.w / np.pi
        if half_over:
            self.held = -c.quadrature_bandwidth * mean - self.wait
        cancels = c.damping_compensation * np.sin(2 * (self.angle - c.damping_axis))
        w = -1j * drive / (2 * frequency) * along
        w = w + (self.held - 1j * abs(u) * (wanted_rate - cancels)) * across
        asked = (2j * frequency * w * turn * np.exp(0.5j * frequency * h)).real
        force = np.clip(asked, -c.force_limit, c.force_limit)
        if half_over:
            if np.all(force == asked):
                self.wait += c.quadrature_bandwidth**2 / 4 * mean * np.pi / self.w
            self.sum = 0.0
        now = np.array([-rate, self.held / self.size, drive / (2 * frequency * self.size)])
        self.out = self.out + (1 - np.exp(-c.output_bandwidth * h)) * (now - self.out)
        self.angle += (wanted_rate + rate) * h
        if self.reverses:
            self.reverse(wanted_rate, (wanted_rate + rate) * h / (2 * np.pi))
        return np.asarray(force)

    def keep(self, u: complex) -> None:
        turned = (self.angle + np.pi) % (2 * np.pi) - np.pi
        rate = self.mean if self.ways == 3 else self.out[0]
        found = {"rate_estimate": rate, "quadrature": self.out[1], "decay_rate": self.out[2]}
        found |= {"pattern_angle": turned, "drive_amplitude": abs(u), "drive_frequency": self.w + self.offset}
        self.reports.append(found | ({"virtual_rate_error": self.scale_error} if self.reverses else {}))

    def follow(self, u: complex, v: complex) -> float:
        e = (u * v.conjugate()).real / max(abs(u) ** 2 + abs(v) ** 2, 0.01 * self.size**2 + 1e-18)
        most, w = 0.1 * self.w, self.c.angle_bandwidth
        self.turning = float(np.clip(self.turning + self.h * w**2 * e, -most, most))
        return float(np.clip(self.turning + 1.4 * w * e, -most, most))

    def drive(self, u: complex) -> tuple[float, float]:
        c, h, most = self.c, self.h, 0.1 * self.w
        phase = u.real / abs(u) if u.imag < 0 else np.copysign(1.0, u.real)
        self.detuning = float(np.clip(self.detuning + h * c.pll_bandwidth**2 * phase, -most, most))
        self.offset = float(np.clip(self.detuning + 1.4 * c.pll_bandwidth * phase, -most, most))
        lacks, gain = self.size - abs(u), 2 * self.w * c.amplitude_bandwidth
        wanted = gain * lacks + self.force
        given = float(np.clip(wanted, -c.force_limit, c.force_limit))
        if (wanted - given) * lacks <= 0:
            grown = self.force + h * gain * c.amplitude_integral * lacks
            self.force = float(np.clip(grown, -c.force_limit, c.force_limit))
        return given, self.w + self.offset

    def reverse(self, wanted: float, part: float) -> None:
        c = self.c
        self.way += part if self.steps >= 0 else 0.0
        self.steps += 1
        time = self.steps * self.h
        if abs(self.way) < c.reversal_turns and time < 8 * np.pi * c.reversal_turns / abs(c.virtual_rate):
            return
        mean = wanted - 2 * np.pi * self.way / time
        self.ways = min(self.ways + 1, 3)
        self.mean = (mean + self.last) / 2
        self.scale_error = (self.last - mean) / (2 * wanted) if self.ways == 3 else 0.0
        self.last, self.sign, self.way = mean, -self.sign, 0.0
        self.steps = -round(10 / min(c.angle_bandwidth, c.demodulation_bandwidth) / self.h)


class Reversal:
    """Mode reversal: the axes are a plain angle of the time, and the loops those of the line with another rebalance."""

    def reset(self, scenario: fg.Scenario) -> None:
        self.c, self.h = scenario.controller, scenario.run.step
        self.loops = Line()
        self.loops.reset(scenario)
        self.held, self.rebalance = np.zeros(2, complex), 0j
        self.read = self.rate = self.bias = 0.0
        self.steps, self.means, self.sums, self.kept = 0, [0.0, 0.0], [], (0.0, 0.0)
        self.known = 0
        self.reports: list[dict[str, float]] = []

    def __call__(self, s: fg.Sample) -> np.ndarray:
        c, h, loops = self.c, self.h, self.loops
        interval, settling = round(c.reversal_interval / h), round(c.settling_time / h)
        swing = round(np.pi / 2 / c.swing_rate / h) if c.swing_rate > 0 else 0
        since = self.steps % (interval + swing)
        other = self.steps // (interval + swing) % 2
        share = max(since - interval, 0) / swing if swing else 0.0
        angle = c.start_angle + np.pi / 2 * (1 - share if other else share)
        if since == 0 and swing == 0 and self.steps > 0:
            self.held = np.array([self.held[1], -self.held[0]])
            self.rebalance = 0j
            kept, self.kept = self.kept, (loops.detuning, loops.force)
            loops.detuning = loops.offset = kept[0]
            loops.force = kept[1]
        turned = (angle + np.pi) % (2 * np.pi) - np.pi
        found = {"rate_estimate": self.rate, "pattern_angle": turned, "reversed_bias": self.bias}
        self.reports.append(found | {"drive_amplitude": abs(self.held[0])})
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        turn = np.exp(1j * loops.theta)
        missed = axes @ np.array(s.position) - (self.held * turn).real
        self.held = self.held + 2 * c.demodulation_bandwidth * h * missed / turn
        drive, frequency = loops.drive(self.held[0])
        loops.theta += frequency * h
        ahead = turn * np.exp(0.5j * frequency * h)
        w = -c.rebalance_bandwidth * self.held[1] - self.rebalance
        asked = (2j * frequency * w * ahead).real
        answer = float(np.clip(asked, -c.force_limit, c.force_limit))
        if answer == asked:
            self.rebalance = self.rebalance + c.rebalance_bandwidth**2 / 4 * h * self.held[1]
        seen = (2j * frequency * w).real / (2 * frequency * loops.size)
        self.read += (1 - np.exp(-c.output_bandwidth * h)) * (seen - self.read)
        if settling <= since < interval:
            self.sums.append(self.read)
            if since == interval - 1:
                self.means[other] = float(np.mean(self.sums))
                self.known, self.sums = self.known + 1, []
                self.bias = (self.means[0] - self.means[1]) / 2 if self.known > 1 else 0.0
            self.rate = self.read + self.bias if other else self.read - self.bias
        self.steps += 1
        return np.asarray(np.clip(np.array([drive * ahead.real, answer]) @ axes, -c.force_limit, c.force_limit))
