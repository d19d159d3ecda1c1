"""An example of a law for the board: `fracgyro enter lab/board/pid_in_python.py --out lab/board/pid_in_python.json`."""

import fracgyro as fg

_, K, *_ = fg.Scenario.paper().plant.nondimensional()  # stiffness xx, xy, yy; the plant is public


class Pid:
    """PID in Python, with the stiffness and the acceleration of the reference as feedforward."""

    ranges = {"kp": (1e3, 2e5), "kd": (10.0, 600.0), "ki": (1e3, 1e7)}

    def __init__(self, kp=4e4, kd=280.0, ki=1e5):
        self.kp, self.kd, self.ki = kp, kd, ki
        self.step, self.ix, self.iy = 0.001, 0.0, 0.0

    def __call__(self, s):
        (ex, ey), (dx, dy) = s.error, s.error_rate
        (rx, ry), (ax, ay) = s.reference, s.reference_acceleration
        self.ix += self.step * self.ki * ex
        self.iy += self.step * self.ki * ey
        ux = ax + K[0] * rx + K[1] * ry - self.kp * ex - self.kd * dx - self.ix
        uy = ay + K[1] * rx + K[2] * ry - self.kp * ey - self.kd * dy - self.iy
        return ux, uy
