"""A loop with every part of a device in volts, for tests of the targets that have one."""

import fracgyro as fg

SHIPPED = fg.Scenario.shipped("dual_mass_volts")
IN_VOLTS = SHIPPED.replace(
    {
        "controller.kind": "force_rebalance",
        "run.duration": 300.0,
        "run.initial_position": (0.0, 0.0),
        "disturbance": [
            {"kind": "noise", "standard_deviation": 1e-7, "seed": 3},
            {"kind": "sine", "quantity": "acceleration", "amplitude": (0.0, 2e-4), "frequency": (0.3, 0.3)},
        ],
        "plant.centrifugal": True,
        "rate.transverse_points": [[0.0, 100.0, -50.0], [0.01, -200.0, 300.0]],
        "device.acceleration_share": (0.0, 0.001),
        "device.common_mode_frequency": (float("inf"), 2000.0),
        "electronics.aperture": 2e-7,
        "electronics.jitter": 1e-9,
        "electronics.feedthrough_lag": 0.4,
        "trim.tuning": "split",
        "trim.quadrature": "null",
        "trim.modulation": 1.2,
        "trim.frequency": 900.0,
        "trim.interval": 0.005,
    }
)
