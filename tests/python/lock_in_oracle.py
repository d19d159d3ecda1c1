"""The controller `lock_in` again, in NumPy and SciPy, from its equations: a dense covariance, the responses of a span
summed sample by sample, sines as formulas, and all work of a span at its end. It shares only the scenario with the
package.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from fracgyro import Scenario
from fracgyro.scenario.to_core import datasheet
from smooth_feedback_oracle import AXES, held

RATE = 4  # after z = [ex, ey, ex', ey'] come Omega_z, Dxx, Dxy, Dyy, Kxx, Kxy, Kyy and the drift of K
SIZE = 12
FAR, WINDOW = 8.0, 128.0


def factors(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P = U diag(d) U^T with U unit upper triangular."""
    p, u, d = p.copy(), np.eye(len(p)), np.zeros(len(p))
    for j in reversed(range(len(p))):
        d[j] = p[j, j]
        u[:j, j] = p[:j, j] / d[j]
        p[:j, :j] -= d[j] * np.outer(u[:j, j], u[:j, j])
    return u, d


class LockIn:
    """A controller whose `step` takes the measured position and returns the force."""

    def __init__(self, scenario: Scenario) -> None:
        c, sheet, self.h = scenario.controller, datasheet(scenario), scenario.run.step
        damping, stiffness, rate, *_ = scenario.plant.nondimensional()
        adaptation, r = scenario.adaptation, scenario.reference
        ratio = adaptation.initial_ratio
        initial_rate = ratio * rate if adaptation.initial_rate is None else adaptation.initial_rate
        self.nominal = np.array([initial_rate, *(ratio * np.array(damping)), *(ratio * np.array(stiffness)), 0.0])
        self.n, self.limit, self.delay = c.span, c.force_limit, sheet.delay
        self.amplitude, self.frequency, self.phase = map(np.array, (r.amplitude, r.frequency, r.phase))
        self.decay = min(c.bandwidth, 0.3 / (self.n * self.h))
        self.design()
        self.prior(sheet, adaptation)
        self.theta = np.zeros(8)
        self.z, self.map = np.zeros(4), self.whole
        along = self.along()
        self.acting = np.array([self.limited(w, a) for a, w in enumerate(along)])
        self.designed = self.acting.copy()
        self.coming = self.acting.copy()  # the requested force; `designed` is the acting one
        self.steps, self.spans = 0, 0
        self.trusted, self.deviation = 0.0, 0.0

    # -- The model of a span ------------------------------------------------------------------------------------------

    def matrices(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """D + 2 Omega and K."""
        omega, dxx, dxy, dyy, kxx, kxy, kyy, _ = theta
        return np.array([[dxx, dxy - 2 * omega], [dxy + 2 * omega, dyy]]), np.array([[kxx, kxy], [kxy, kyy]])

    def design(self) -> None:
        h, n, w = self.h, self.n, self.frequency
        d, k = self.matrices(self.nominal)
        flow = np.block([[np.zeros((2, 2)), np.eye(2)], [-k, -d]])
        f, g = held(flow, np.vstack([np.zeros((2, 2)), np.eye(2)]), h)
        self.whole = np.linalg.matrix_power(f, n)
        self.hold = []  # held forces instead of continuous ones, line by line
        for line in w * (1 + 1e-6):
            continuous = np.linalg.inv(k + 1j * line * d - line**2 * np.eye(2))
            sampled = np.linalg.solve(np.exp(1j * line * h) * np.eye(4) - f, g)[:2]
            self.hold.append(np.exp(-0.5j * line * h) * np.linalg.solve(sampled, continuous))
        own = [held(np.array([[0, 1], [-k[a, a], -d[a, a]]]), np.array([[0.0], [1.0]]), h) for a in range(AXES)]
        self.measured = np.zeros((4, 4))  # number, z
        self.respond = np.zeros((AXES, AXES, 4), complex)  # axis, line, [e, e', its two numbers]
        self.change = np.zeros((AXES, AXES, 2, 2, 2))
        self.noise, self.within, self.single = np.zeros((4, 4)), np.zeros(4), np.zeros(4)
        powers = [[np.linalg.matrix_power(m, j) for j in range(n + 1)] for m, _ in own]
        for a, (_, push) in enumerate(own):
            angle = w[1 - a] * h * (np.arange(n) - (n - 1) / 2)
            weights = np.array([np.cos(angle), np.sin(angle)]) / n
            numbers, states = slice(2 * a, 2 * a + 2), [a, 2 + a]
            self.single[numbers] = (weights**2).sum(1)
            self.measured[numbers, states[0]] = weights @ [p[0, 0] for p in powers[a][:n]]
            self.measured[numbers, states[1]] = weights @ [p[0, 1] for p in powers[a][:n]]
            impulse = np.array([p @ push[:, 0] for p in powers[a]])  # by the steps since
            later = np.zeros((n, 2))  # change of the numbers by a force in step i
            for i in range(n):
                later[i] = weights[:, i + 1 :] @ impulse[: n - 1 - i, 0]
            at_end = impulse[n - 1 - np.arange(n)]
            self.within[numbers] = (later**2).sum(0)
            self.noise[np.ix_(states, states)] = at_end.T @ at_end
            for b in range(AXES):
                turn = np.exp(1j * w[b] * h * np.arange(n))
                self.respond[a, b] = self.amplitude[b] * (turn @ np.hstack([at_end, later]))
                middle = np.array([(powers[b][j] + powers[b][j + 1]) / 2 for j in range(n)])
                for m in range(2):
                    self.change[a, b, m] = -np.einsum("ji,jk->ik", at_end, middle[:, m])

    def prior(self, sheet: Any, adaptation: Any) -> None:
        h, (d, k) = self.h, self.matrices(self.nominal)
        natural = math.sqrt((k[0, 0] + k[1, 1]) / 2)
        amplitude = abs(self.amplitude).max()
        fastest = max(abs(self.amplitude * self.frequency).max(), amplitude * natural)
        self.unit = max(sheet.position_noise, 1e-6 * math.sqrt(h)) ** 2
        force = max(sheet.force_noise, 1e-10) ** 2
        self.r = self.unit * self.single + force * self.within
        self.q = force * self.noise
        of_rate = (0.05 * natural) ** 2
        plant = [of_rate] * 4 + [of_rate * natural**2] * 3 + [sheet.stiffness_drift**2]
        self.before = np.array([amplitude**2] * 2 + [fastest**2] * 2 + plant)
        self.p = np.diag(self.before)
        time = self.n * h

        def information(on: int, of: int, w: float) -> float:
            lines = [self.frequency[of] + w, self.frequency[of] - w]
            noise = [force * h + ((k[on, on] - f**2) ** 2 + (d[on, on] * f) ** 2) * self.unit * h for f in lines]
            return float(self.amplitude[of] ** 2 / 4 * sum(1 / each for each in noise))

        self.drift = np.zeros(8)
        if v := adaptation.rate_forgetting:
            known = sum(4 * self.frequency[b] ** 2 * information(1 - b, b, v) for b in range(AXES))
            self.drift[0] = v**2 * time / known
        w = adaptation.forgetting
        for place, pairs in enumerate([[(0, 0)], [(0, 1), (1, 0)], [(1, 1)]]):
            known = sum(information(on, of, w) for on, of in pairs)
            rates = sum(self.frequency[of] ** 2 * information(on, of, w) for on, of in pairs)
            entry = self.nominal[1 + place]
            self.drift[1 + place] = w**2 * time / rates + (sheet.damping_drift * entry) ** 2 * 100 * time
            self.drift[4 + place] = w**2 * time / known
        self.drift[7] = sheet.stiffness_drift**2 * time / 1e8
        self.ramp = time * np.array([k[0, 0], k[0, 1], k[1, 1]])
        self.squares, self.means, self.explained = 1.0, np.zeros(2), 0.0
        self.beyond = self.age = self.lasting = 0
        self.lag = 0.0

    def along(self) -> np.ndarray:
        """The force of each axis at each line that keeps the estimated plant on the reference."""
        d, k = self.matrices(self.nominal + self.theta)
        columns = [
            self.hold[b] @ (k[:, b] - w**2 * np.eye(2)[b] + 1j * w * d[:, b]) for b, w in enumerate(self.frequency)
        ]
        return np.array(columns).T

    def limited(self, w: np.ndarray, axis: int) -> np.ndarray:
        most = (1 - 1e-5) * self.limit
        return w * min(1.0, most / max(float(abs(self.amplitude) @ abs(w)), 1e-30))

    # -- Each step ----------------------------------------------------------------------------------------------------

    def angle(self, step: float) -> np.ndarray:
        return self.phase + self.frequency * self.h * step

    def step(self, position: Any) -> np.ndarray:
        if self.steps % self.n == 0:
            self.begin_span()
        now = self.angle(self.steps)
        e = np.asarray(position) - self.amplitude * np.sin(now)
        middle = self.angle(self.steps - self.steps % self.n + (self.n - 1) / 2)
        local = np.exp(1j * (now - middle))
        self.sums += local[::-1] * e / self.n
        self.steps += 1
        turn = np.exp(1j * (now + (self.delay + 0.5) * self.frequency * self.h))
        return np.clip((self.modulation * self.amplitude * turn).imag.sum(1), -self.limit, self.limit)

    def begin_span(self) -> None:
        if self.spans:
            self.learn()
        self.acted, self.acting, self.modulation = self.acting, self.designed, self.coming
        self.sums = np.zeros(2, complex)
        self.start = self.angle(self.steps)
        if self.spans == 0:
            self.lack = self.acting - self.along()
        self.spans += 1

    # -- Once in a span, at its end -----------------------------------------------------------------------------------

    def learn(self) -> None:
        """From the sums of the span that ends here: the force of the one after the next follows."""
        if self.spans > 1:
            self.correct_by(self.past)
        self.past = self.sums
        turn = np.exp(1j * (self.start + self.frequency * self.h / 2))
        self.x = self.respond * turn[None, :, None]
        self.lack = self.acting - self.along()
        ahead = self.after(self.z)
        # alpha sin + beta cos at the end of this span
        angle, e, v = self.angle(self.steps), ahead[:2], ahead[2:] / self.frequency
        alpha, beta = e * np.sin(angle) + v * np.cos(angle), e * np.cos(angle) - v * np.sin(angle)
        w = self.along() + np.diag(2 * self.decay * self.frequency / self.amplitude * (beta - 1j * alpha))
        self.coming = np.array([self.limited(row, a) for a, row in enumerate(w)])
        self.designed = self.coming + self.delay / self.n * (self.acting - self.coming)

    def after(self, z: np.ndarray) -> np.ndarray:
        forced: np.ndarray = (self.x * self.lack[:, :, None]).imag.sum(1)
        return self.map @ z + forced[:, :2].T.ravel()

    def sensitivity(self) -> np.ndarray:
        """Sensitivity of [e, e', numbers] of each axis to theta: (axis, four, 8)."""
        found = np.zeros((AXES, 4, 8))
        for a in range(AXES):
            for b in range(AXES):
                damping, stiffness = -self.frequency[b] * self.x[a, b].real, -self.x[a, b].imag
                found[a, :, 1 + a + b] += damping
                found[a, :, 4 + a + b] += stiffness
                found[a, :, 0] += 2 * (a - b) * damping
        return found

    def correct_by(self, sums: np.ndarray) -> None:
        sensitivity = self.sensitivity()
        forced = (self.x * self.lack[:, :, None]).imag.sum(1)[:, 2:].ravel()
        seen = np.array([[s.real, s.imag] for s in sums]).ravel()
        difference = seen - self.measured @ self.z - forced
        moved, far, sums3 = np.zeros(SIZE), 0, np.zeros(3)
        turns = (self.n * self.h / 2) ** 2
        unknown, moved_by = turns * (self.p[8, 8] + self.p[10, 10]), turns * (self.theta[4] ** 2 + self.theta[6] ** 2)
        for i in range(4):
            row = np.hstack([self.measured[i], sensitivity[i // 2, 2 + i % 2]])
            innovation = difference[i] - row @ moved
            motion = self.z[i // 2] ** 2 + self.z[2 + i // 2] ** 2
            product = unknown * (innovation**2 + motion) + moved_by * motion
            variance = row @ self.p @ row + self.r[i] + product
            u, _ = factors(self.p)
            g = row @ u[:, RATE]  # sensitivity to Omega_z beyond that to the parameters after it
            inside = innovation**2 < FAR**2 * (variance + self.lag * g**2)
            far |= not inside
            if not inside and self.beyond < 3:
                continue
            gain = self.p @ row / variance
            moved += gain * innovation
            self.p -= np.outer(gain, gain) * variance
            sums3 += [innovation**2 / variance / 4, g * innovation / variance, g**2 / variance]
        self.z = self.z + moved[:4]
        self.theta = self.theta + moved[4:]
        self.theta[4:7] += self.theta[7] * self.ramp
        self.judge(sums3, far)
        self.propagate(sensitivity)

    def judge(self, sums: np.ndarray, far: int) -> None:
        self.beyond = far * min(self.beyond + 1, 3)
        self.age += 1
        if self.age >= 32:
            self.squares += (sums[0] - self.squares) / WINDOW
            self.means += (sums[1:] - self.means) / WINDOW
        now = self.means[0] ** 2 / max(self.means[1], 1e-300) / 4
        self.explained += (now - self.explained) / (8 * WINDOW)
        off = self.squares - now >= 1.25 + 3 * self.explained
        self.lasting = max(self.lasting + (1 if off else -1), 0)
        chance = 0.125 / WINDOW
        explained = max(now - 16 * chance, self.explained - 3 * chance, 0)
        self.lag = 4 * explained / self.means[1] if explained else 0.0
        lag = max(explained, self.squares - 1.25)
        variance = self.p[RATE, RATE]
        stated = variance * max(self.squares - now, 1) + (4 * lag / self.means[1] if lag else 0)
        self.deviation = math.sqrt(stated)
        _, d = factors(self.p)
        known = variance < 10 * d[RATE] and variance < 0.01 * self.before[RATE] and self.age >= 256
        self.trusted = float(known and not off and not far)

    def propagate(self, sensitivity: np.ndarray) -> None:
        d, k = self.matrices(self.theta)
        self.map = self.whole.copy()
        for a in range(AXES):
            for b in range(AXES):
                more = k[a, b] * self.change[a, b, 0] + d[a, b] * self.change[a, b, 1]
                self.map[np.ix_([a, 2 + a], [b, 2 + b])] += more
        self.lack = self.acted - self.along()
        self.z = self.after(self.z)
        whole = np.eye(SIZE)
        whole[:4, :4] = self.map
        whole[:4, 4:] = sensitivity[:, :2].transpose(1, 0, 2).reshape(4, 8)
        whole[8:11, 11] = self.ramp
        self.p = whole @ self.p @ whole.T
        self.p[:4, :4] += self.q
        u, factor = factors(self.p)
        growth = np.maximum(1 - factor[4:] / np.maximum(self.before[4:], 1e-300), 0)
        factor[5:] += self.drift[1:] * growth[1:]
        self.p = u @ np.diag(factor) @ u.T
        haste = 1000 if self.age < 256 else 1
        self.p[RATE, RATE] += min(haste * self.drift[0], self.before[RATE]) * growth[0]
