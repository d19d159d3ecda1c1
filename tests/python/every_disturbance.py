"""Every kind of disturbance, in one list; the first entry is a sine, which an importer of an FMU can set."""

ENTRIES = [
    {"kind": "sine", "amplitude": [0.7, -0.3], "frequency": [2.0, 7.0], "seed": 3},
    {"kind": "noise", "standard_deviation": 2.0, "hold": 3e-3, "start": 0.2, "end": 1.1},
    {"kind": "noise", "standard_deviation": 1.5, "band": [0.0, 50.0]},
    {"kind": "step", "amplitude": [2.0, -1.0], "start": 0.5},
    {"kind": "pulse", "amplitude": [30.0, -4.0], "start": 1.0004, "width": 0.0123},
    {"kind": "vibration", "psd": [[2.0, 0.01], [20.0, 0.1], [200.0, 0.02]]},
    {"kind": "table", "points": [[0.0, 0.0, 2.0], [0.1, 1.0, -1.0], [0.25, 0.5, 2.0]], "start": 0.4},
]
