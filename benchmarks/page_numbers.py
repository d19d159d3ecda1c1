"""Sources of the measured numbers and tables of README.md and docs/: a log, a row, a column."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial

import logs
from logs import number, numbers, said
from words import short, spelled

Rows = list[list[str]]


def cell(log: str, column: str, /, **cells: str) -> str:
    """The one cell of this column in a row with these cells; `where` and so on, or `**{heading: cell}`."""
    found = {r[column] for r in logs.rows(log, column, *cells) if cells.items() <= r.items()}
    if len(found) != 1:
        raise ValueError(f"{logs.log_of(log)} has {len(found)} cells of {column} with {cells}: one is needed")
    return found.pop()


def digits(text: str, count: int = 2) -> str:
    """The first number of a cell with `count` significant digits; other text stays."""
    return short(number(text), count) if re.search(r"\d", text) else text


def thousands(value: float) -> str:
    return f"{value:,.0f}"


def uncertain(text: str) -> str:
    """`mean (low to high)` or `mean ± half` as mean ± half, rounded to the half's first digit, or only as mean."""
    mean, *rest = numbers(text)
    half = (rest[1] - rest[0]) / 2 if len(rest) == 2 else rest[0]
    if half < 1e-3 * abs(mean):
        return thousands(float(f"{mean:.3g}")).replace("-", "−")
    exponent = int(f"{half:.0e}".partition("e")[2])
    shown = (f"{round(value, -exponent):,.{max(0, -exponent)}f}" for value in (mean, half))
    return " ± ".join(shown).replace("-", "−").replace("−0 ", "0 ")


# -- docs/rate_sensor.md -----------------------------------------------------------------------------------------------

NOISY = "positions only, 1e-13 m/√Hz"
NAMES = {
    "dual_mass": "dual mass in vacuum",
    "tuned_in_air": "tuned, in air",
    "paper_resonance": "paper, at resonance",
    "disc": "disc, Q = 2·10⁶",
}
ARW, BOUND = "Angle random walk (deg/sqrt(h))", "the bound of ARW, D and K known"
SCALE, TURN_ON = "Scale factor error (ppm)", "Turn-on time (ms)"
OUTPUT, RMS = "zero-rate output (deg/h)", "RMS at rest (deg/h)"
SHORT_ARW, SHORT_SCALE = "angle random walk (deg/sqrt(h))", "scale factor error (ppm)"
RATIO, JOINT = "ratio (95 %)", "Joint adaptation, positions with sensing noise"


def joint(device: str, column: str) -> str:
    return cell("rate_sensor", column, where=f"{device}, {NOISY}", law="joint")


def real_electronics() -> Rows:
    rows = []
    for device, words in NAMES.items():
        lag = cell("rate_response", "lag there", section=JOINT, scenario=device, set="100 Hz")
        first = [digits(joint(device, column)) for column in (SCALE, ARW)]
        rows.append([words, *first, digits(joint(device, BOUND)), digits(joint(device, "Bandwidth (Hz)")), lag])
        rows[-1].append(digits(joint(device, TURN_ON)))
    return rows


def sensing(device: str, noise: str, column: str) -> str:
    return cell("sensing_noise", column, **{"device": device, "noise (m/√Hz)": noise, "sensed": "q"})


def misjudged(column: str) -> list[float]:
    """A column of the rows in which a datasheet states 100 times the noise or a hundredth of it."""
    rows = logs.rows("sensing_noise", "seeds", "stated over seen", "RMS error (deg/h)")
    found = [row for row in rows if any("datasheet: S" in cell for cell in row.values())]
    return [numbers(row[column])[0] for row in found]


def at_the_bound() -> Rows:
    rows, noises = [], ("0", "1e-14", "1e-13", "1e-12")
    for device, words in NAMES.items():
        walks = [digits(sensing(device, noise, "angle random walk (deg/√h)")) for noise in noises]
        ratios = [number(sensing(device, noise, RATIO)) for noise in noises]
        highest = max(numbers(sensing(device, noise, RATIO))[2] for noise in noises)
        rows.append([words, *walks, f"{min(ratios):.2f} to {max(ratios):.2f}", f"{highest:.2f}"])
    return rows


REAL = "Positions with sensing noise, and more"
FAULTS = {
    "as shipped": "as shipped",
    "flicker noise too, corner 1000 Hz": "flicker noise too, corner 1 kHz",
    "16 bit": "16 bit of ±1.25 amplitudes",
    "12 bit": "12 bit",
    "delay of one step, in the datasheet": "force one step late, in the datasheet",
    "… not in the datasheet": "… not in the datasheet",
    "stiffness drift of -30 ppm/K, 10 K": "stiffness falls by 300 ppm in 0.81 s",
    "… D and K forgotten at 100 Hz": "… and D, K are forgotten at 100 Hz",
    "damping drift of 3000 ppm/K, the same": "damping rises by 3 % in 0.81 s, the same",
    "pick-off of x 1 % off": "pick-off of x 1 % off",
    "force on x 1 % off": "force on x 1 % off",
    "pick-offs turned by 1 mrad": "pick-offs turned by 1 mrad",
    "actuators turned by 1 mrad": "actuators turned by 1 mrad",
    "16 bit, flicker, delay known, drift tracked": "16 bit, flicker, delay known, drift tracked",
}
EXACT = "Exact sensors, and what a device is not ideal in"
EXACT_FAULTS = {
    "ideal": "ideal",
    "16 bit sensing": "16 bit sensing, of ±1.25 times the largest motion",
    "12 bit sensing": "12 bit sensing",
    "sensing noise": "sensing noise, 10⁻¹³ m/√Hz and ω0 times that of velocity",
    "loop delay of one step": "force one step late",
    "stiffness drift of -30 ppm/K, 10 K": "stiffness falls by 300 ppm in 0.81 s",
    "… D and K forgotten at 10 Hz": "… and D, K are forgotten at 10 Hz",
    "positions only, observer at 10 ω0": "positions only, observer at 10 ω0",
    "… at 30 ω0, a fifth of the step": "… at 30 ω0, in a fifth of the step",
    "… and 16 bit": "… and 16 bit",
}


def effect(section: str, effect: str, column: str, device: str = "dual_mass") -> str:
    return cell("rate_sensor", column, section=section, scenario=device, effect=effect)


def rms(section: str, of: str, device: str = "dual_mass") -> str:
    return thousands(float(f"{number(effect(section, of, RMS, device)):.2g}"))


def faults() -> Rows:
    return [
        [words, digits(effect(REAL, of, SHORT_SCALE)), uncertain(effect(REAL, of, OUTPUT)), rms(REAL, of)]
        for of, words in FAULTS.items()
    ]


def trust() -> Rows:
    """Faults of sensors, of both sensings and with the guard on and off, by device."""
    found = []
    for device, words in NAMES.items():
        rows = [row for row in logs.rows("off_model", "faults", "largest, ms") if row["device"] == device]
        rows = [row for row in rows if row["sensing"] != "composite"]
        late = sum(int(number(row["not within 50 ms"])) for row in rows)
        turns = [row for row in logs.rows("off_model", "rate", "trusted, %") if row["device"] == device]
        turns = [row for row in turns if row["section"] == "Rates that turn"]
        found.append(
            [
                words,
                f"{sum(int(number(row['faults'])) for row in rows)}",
                f"{max(number(row['wrong while trusted, %']) for row in rows):.3f}",
                f"{max(number(row['largest, ms']) for row in rows):.0f}",
                f"{late}",
                f"{min(number(row['trusted, %']) for row in turns if 'from rest' in row['rate']):.1f}",
                f"{min(number(row['trusted, %']) for row in turns if 'first sample' in row['rate']):.1f}",
                f"{max(number(row['wrong while trusted, %']) for row in turns):.2f}",
            ]
        )
    return found


def of_composite(column: str) -> list[float]:
    rows = logs.rows("off_model", "faults", "largest, ms")
    return [number(row[column]) for row in rows if row["sensing"] == "composite"]


def late() -> list[float]:
    """RMS error in deg/s of each device with an unstated delay."""
    rows = logs.rows("off_model", "device", "RMS error, deg/s")
    return [number(row["RMS error, deg/s"]) for row in rows if "A delay" in row["section"]]


def of_fast_turns(device: str) -> float:
    """Maximum share in % of a device's samples that are trusted but wrong in turns faster than the bandwidth."""
    rows = [row for row in logs.rows("off_model", "rate", "trusted, %") if "faster" in row["section"]]
    of = [(number(row["trusted, %"]), number(row["wrong while trusted, %"])) for row in rows if row["device"] == device]
    return max(trusted * wrong / 100.0 for trusted, wrong in of)


MINUTE, HIDDEN = "A slow drift for a minute", "Hidden delay on each device"


def longer() -> Rows:
    """A slow drift, and hidden delay on each device."""
    drifts = [row["effect"] for row in logs.rows("rate_sensor", "effect", RMS) if row["section"] == MINUTE]
    places = [("dual mass in vacuum", "dual_mass", MINUTE, of) for of in drifts]
    delays = [row["effect"] for row in logs.rows("rate_sensor", "effect", RMS) if row["section"] == HIDDEN]
    places += [(words, device, HIDDEN, of) for device, words in NAMES.items() for of in dict.fromkeys(delays)]
    return [
        [
            words,
            of,
            digits(effect(section, of, SHORT_SCALE, device)),
            uncertain(effect(section, of, OUTPUT, device)),
            rms(section, of, device),
        ]
        for words, device, section, of in places
    ]


LAWS = [
    (
        "paper, its noise, off resonance: gradient laws",
        "paper, its noise, off resonance",
        "laws (44), the paper's gains",
    ),
    ("… composite", "paper, its noise, off resonance", "composite"),
    (
        "paper, thermal noise, off resonance: gradient laws",
        "paper, thermal noise, off resonance",
        "laws (44), the paper's gains",
    ),
    ("… composite", "paper, thermal noise, off resonance", "composite"),
    ("paper, at resonance: gradient laws, other gains", "paper_resonance", "laws (44), gains for resonance"),
    ("… composite", "paper_resonance", "composite"),
    ("dual mass in vacuum, composite", "dual_mass", "composite"),
    ("tuned, in air, composite", "tuned_in_air", "composite"),
    ("disc, Q = 2·10⁶, composite", "disc", "composite"),
]


def exact_sensors() -> Rows:
    return [
        [words, *(digits(cell("rate_sensor", column, where=where, law=law)) for column in (ARW, BOUND, SCALE, TURN_ON))]
        for words, where, law in LAWS
    ]


def exact_faults() -> Rows:
    return [
        [
            words,
            digits(effect(EXACT, of, SHORT_SCALE)),
            uncertain(effect(EXACT, of, OUTPUT)),
            rms(EXACT, of),
            digits(effect(EXACT, of, SHORT_ARW)),
        ]
        for of, words in EXACT_FAULTS.items()
    ]


def composite_noisy() -> float:
    return number(effect(EXACT, "sensing noise", SHORT_ARW))


def gains(p: str, corner: str) -> list[float]:
    return numbers(cell("resonance_gains", f"ρ/δ = {corner} ω0", P=p))


RATE_SENSOR: dict[str, Callable[[], str]] = {
    "sensor.composite": lambda: short(composite_noisy()),
    "sensor.composite_over": lambda: short(composite_noisy() / number(joint("dual_mass", ARW))),
    "sensor.observer_low": lambda: short(
        number(effect(EXACT, "… at 30 ω0, a fifth of the step", SHORT_SCALE)) / 1e4, 1
    ),
    "sensor.observer_high": lambda: short(
        number(effect(EXACT, "positions only, observer at 10 ω0", SHORT_SCALE)) / 1e4
    ),
    "sensor.lag": lambda: cell("rate_response", "lag there", section=JOINT, scenario="dual_mass", set="100 Hz"),
    "sensor.lag_air": lambda: cell("rate_response", "lag there", section=JOINT, scenario="tuned_in_air", set="100 Hz"),
    "sensor.overshoot": lambda: digits(
        cell("rate_response", "overshoot", section=JOINT, scenario="dual_mass", set="100 Hz"), 1
    ),
    "sensor.rest": lambda: f"{number(joint('dual_mass', 'ARW over it')):.1f}",
    "sensor.air_turned": lambda: short(
        number(effect(REAL, "pick-offs turned by 1 mrad", OUTPUT, "tuned_in_air"))
        / number(effect(REAL, "pick-offs turned by 1 mrad", OUTPUT))
    ),
    "sensor.drift_rms": lambda: rms(REAL, "stiffness drift of -30 ppm/K, 10 K"),
    "trust.composite_runs": lambda: thousands(sum(of_composite("faults"))),
    "trust.composite_late": lambda: thousands(sum(of_composite("not within 50 ms"))),
    "trust.composite_wrong": lambda: short(max(of_composite("wrong while trusted, %"))),
    "noise.misjudged": lambda: f"{100 * max(abs(ratio - 1) for ratio in misjudged('ratio (95 %)')):.0f}",
    "noise.least_stated": lambda: short(min(misjudged("stated over seen"))),
    "noise.most_stated": lambda: short(max(misjudged("stated over seen"))),
    "trust.fast_disc": lambda: short(of_fast_turns("disc")),
    "trust.fast_others": lambda: short(max(of_fast_turns(each) for each in NAMES if each != "disc")),
    "trust.least_late": lambda: short(min(late())),
    "trust.most_late": lambda: short(max(late())),
    "sensor.coarse": lambda: short(
        number(effect(REAL, "12 bit", "Allan deviation (deg/h)"))
        / number(effect(REAL, "as shipped", "Allan deviation (deg/h)"))
    ),
    "sensor.published": lambda: digits(cell("rate_sensor", ARW, where=LAWS[0][1], law=LAWS[0][2]), 3),
    "sensor.thermal": lambda: digits(cell("rate_sensor", ARW, where=LAWS[2][1], law=LAWS[2][2])),
    "sensor.thermal_on": lambda: digits(cell("rate_sensor", TURN_ON, where=LAWS[2][1], law=LAWS[2][2])),
    "sensor.resonant": lambda: digits(cell("rate_sensor", ARW, where=LAWS[4][1], law=LAWS[4][2])),
    "sensor.slow_off": lambda: short(gains("0.1", "0.1")[0] / 300 * 100),
    "sensor.fast_off": lambda: short(gains("0.1", "3")[0] / 300 * 100, 1),
    "sensor.from_rest": lambda: said("resonance_gains", r"(\d+) times the rate from rest"),
    "sensor.kalman_low": lambda: said("rate_response", r"The ratio is ([\d.]+) to"),
    "sensor.kalman_high": lambda: said("rate_response", r"The ratio is [\d.]+ to ([\d.]+)"),
}

# -- docs/firmware.md --------------------------------------------------------------------------------------------------

SIXTEEN = "16 exponentials, c = 0.6"
M7 = "Cortex-M7: mean / most"
BYTES = "bytes: coefficients + state"


def counted(controller: str, column: str = M7, scalar: str = "float") -> list[float]:
    return numbers(cell("firmware", column, controller=controller, scalar=scalar))


def mean(controller: str) -> float:
    return counted(controller)[0]


def budgets() -> Rows:
    def verdict(found: list[tuple[str, float]], most: float) -> str:
        within = [f"{words}{thousands(value)}" for words, value in found if value <= most]
        beyond = [f"{words}{thousands(value)}" for words, value in found if value > most]
        return "; ".join(([", ".join(within)] if within else []) + (["missed: " + ", ".join(beyond)] if beyond else []))

    means = [
        ("", mean(SIXTEEN)),
        ("with a force limit ", mean(f"{SIXTEEN}, force limit")),
        ("and samples checked ", mean(f"{SIXTEEN}, force limit, samples checked")),
    ]
    within = [(f"with {exponentials} exponentials ", instructions) for exponentials, instructions in [close_enough()]]
    own = [row for row in logs.rows("firmware", BYTES) if row["scalar"] == "float" and "paper" in row["controller"]]
    own = [row for row in own if "composite" not in row["controller"]]
    own += [
        row
        for row in logs.rows("firmware", BYTES)
        if row["scalar"] == "float" and re.match(r"(16|6|fast: 8) exponentials", row["controller"])
    ]
    stacks = [value for row in own for value in numbers(row["stack M4F / M7"])]
    image = max(counted(SIXTEEN, "image M4F / M7")) / 1000
    data = sum(counted(SIXTEEN, BYTES)) / 1000
    return [
        ["16 exponentials, general c, mean", "1,050 instructions", verdict(means, 1050)],
        ["c = 1/2, RMSE within 1 % of double with 21 exponentials, mean", "450 instructions", verdict(within, 450)],
        ["stack of a step", "256 bytes", f"{min(stacks):.0f} to {max(stacks):.0f}"],
        ["code and constants, 16 exponentials", "10 kB", f"{image:.1f} kB"],
        ["coefficients and state, 16 exponentials", "1 kB", f"{'missed: ' if data > 1 else ''}{data:.1f} kB"],
    ]


def limit() -> Rows:
    columns = ("chattering ≤ 0.0035", "≤ 0.05", "no ceiling", "best estimate", "t < 10")
    return [
        [
            f"`{row['scenario']}`, {row['sensing']}" + (f", {row['noise (m/√Hz)']} m/√Hz" if noisy else ", no noise"),
            *(row[column] for column in columns),
        ]
        for row in logs.rows("limit", *columns)
        for noisy in [number(row["noise (m/√Hz)"]) > 0.0]
    ]


def near_limit() -> Rows:
    columns = ("bandwidth", "error x, y", "over limit", "with a hidden step")
    return [
        [
            row["sensing"],
            f"≤ {row['ceiling']}",
            f"`{row['law']}`, {row['margin']}",
            *(row[column] for column in columns),
        ]
        for row in logs.rows("limit", *columns)
        if number(row["noise (m/√Hz)"]) > 0.0
    ]


def reference_cost() -> Rows:
    def means(row: logs.Row, column: str) -> str:
        return thousands(numbers(row[column])[0])

    columns = ("Cortex-M4F: mean / most", "Cortex-M7: mean / most")
    return [
        [row["reference, on both axes"], *(means(row, column) for column in columns)]
        for row in logs.rows("reference_cost", *columns)
    ]


def change(controller: str, window: str) -> list[float]:
    return numbers(cell("firmware", window, controller=controller))


def close_enough() -> tuple[str, float]:
    """Exponentials and instructions of the cheapest step whose RMSE is within 1 % of that with 21 exponentials."""
    names = {row["controller"]: row["exponentials"] for row in logs.rows("firmware", "t >= 10: x, y")}
    names = {name: count for name, count in names.items() if name.endswith("exponentials")}
    windows = ("whole run: x, y", "t >= 10: x, y")
    kept = [n for n in names if max(abs(e) for window in windows for e in change(n, window)) <= 1]
    best = min(kept, key=mean)
    return names[best], mean(best)


def per_exponential() -> float:
    return (mean("fast: 8 exponentials") - mean("6 exponentials")) / 2


FIRMWARE: dict[str, Callable[[], str]] = {
    "loop.ends": lambda: f"{min(numbers(corrected('at t'))) / 1000:.1f}",
    "firmware.limit_m7": lambda: (
        f"{mean(f'{SIXTEEN}, force and switching limit') - mean(f'{SIXTEEN}, force limit'):.0f}"
    ),
    "firmware.limit_m4": lambda: "{:.0f}".format(
        counted(f"{SIXTEEN}, force and switching limit", "Cortex-M4F: mean / most")[0]
        - counted(f"{SIXTEEN}, force limit", "Cortex-M4F: mean / most")[0]
    ),
    "firmware.checked": lambda: "{:.0f}".format(
        mean(f"{SIXTEEN}, force limit, samples checked") - mean(f"{SIXTEEN}, force limit")
    ),
    "firmware.checked_stack": lambda: "{:.0f}".format(
        counted(f"{SIXTEEN}, force limit, samples checked", "stack M4F / M7")[1]
        - counted(f"{SIXTEEN}, force limit", "stack M4F / M7")[1]
    ),
    "firmware.composite": lambda: thousands(mean("paper, composite")),
    "firmware.composite_stack": lambda: f"{counted('paper, composite', 'stack M4F / M7')[1]:.0f}",
    "firmware.integer": lambda: f"{mean('fast terminal, no exponentials'):.0f}",
    "firmware.integer_stack": lambda: f"{counted('fast terminal, no exponentials', 'stack M4F / M7')[1]:.0f}",
    "firmware.six": lambda: f"{mean('6 exponentials'):.0f}",
    "firmware.six_rmse": lambda: short(max(map(abs, change("6 exponentials", "t >= 10: x, y")))),
    "firmware.each": lambda: f"{per_exponential():.0f}",
    "firmware.none": lambda: f"{mean('6 exponentials') - 6 * per_exponential():.0f}",
    "firmware.root": lambda: f"{mean(SIXTEEN) - mean('16 exponentials'):.0f}",
    "firmware.close": lambda: f"{close_enough()[1]:.0f}",
    "firmware.close_with": lambda: close_enough()[0],
    "firmware.eight_whole": lambda: short(max(map(abs, change("fast: 8 exponentials", "whole run: x, y"))), 1),
    "firmware.eight_x": lambda: short(abs(change("fast: 8 exponentials", "t >= 10: x, y")[0]), 1),
    "firmware.eight_y": lambda: short(abs(change("fast: 8 exponentials", "t >= 10: x, y")[1])),
    "firmware.single": lambda: short(max(map(abs, change("paper", "t >= 10: x, y"))), 1),
}

# -- docs/paper.md -----------------------------------------------------------------------------------------------------


def corrected(column: str) -> str:
    return cell("boundedness", column, reading="as corrected", layer="linear (its own)")


def evidence(claim: str, variant: str) -> str:
    return cell("reproduction", "evidence", **{"": claim, "variant": variant})


def held(claim: str, variant: str) -> str:
    return "yes" if cell("reproduction", "verdict", **{"": claim, "variant": variant}) == "reproduced" else "no"


def found_in(claim: str, variant: str, pattern: str) -> list[float]:
    found = re.search(pattern, evidence(claim, variant))
    if found is None:
        raise ValueError(f"claim {claim}, {variant}: benchmarks/results/reproduction.md has no {pattern!r}")
    return [number(each) for each in found.groups()]


def holding(variant: str) -> str:
    rows = logs.rows("reproduction", "verdict")
    return spelled(sum(row["variant"] == variant and row["verdict"] == "reproduced" for row in rows))


def claims() -> Rows:
    printed, ours = "printed", "corrected"
    settled = {v: found_in("a", v, r"below 0\.01 from t = ([\d.]+).* 0\.001: ([\d.]+)") for v in (printed, ours)}
    slower = {v: found_in("b", v, r"settles at ([\d.]+)")[0] for v in (printed, ours)}
    lost = [1 - gain / 100 for gain in found_in("c", ours, r"steady x ([-+\d.]+)%.*steady y ([-+\d.]+)%")]
    rises = found_in("d", ours, r"up to ([\d.]+), ([\d.]+), ([\d.]+) of V")
    rate, damping = found_in("f", ours, r"Ω̂z off by ([\d.]+).*D̂ off by ([\d.]+)")
    best = {v: evidence("h", v).count("α = 0.9 (") for v in (printed, ours)}
    cost = {v: found_in("i", v, r"takes ([\d.]+) times")[0] for v in (printed, ours)}
    ends = min(numbers(corrected("at t"))) / 1000
    return [
        [
            "a",
            "tracking error zero in under 5 s",
            f"{held('a', printed)}: below 1 % for good from {settled[printed][0]:.1f}",
            f"{held('a', ours)} at 1 %: {settled[ours][0]:.1f}; no at 0.1 %: {settled[ours][1]:.1f}",
        ],
        [
            "b",
            "fractional SMC needs about 10 s",
            f"{held('b', printed)}: {slower[printed]:.1f}",
            f"{held('b', ours)}: {slower[ours]:.1f}, mostly faster than the proposed",
        ],
        [
            "c",
            "more accurate than conventional fast terminal SMC",
            held("c", printed),
            f"{held('c', ours)}: steady error {lost[0]:.1f} and {lost[1]:.1f} times as large",
        ],
        [
            "d",
            "the surface converges, its Lyapunov function never rises",
            f"{held('d', printed)}: s does, V rises",
            "s: yes, to a noise-set bound; V: in the limit h → 0 only, it rises by "
            + ", ".join(short(100 * rise) for rise in rises)
            + " % at h, h/2, h/4",
        ],
        ["e", "no chattering", held("e", printed), held("e", ours)],
        [
            "f",
            "D̂, K̂, Ω̂z converge to the truth",
            f"{held('f', printed)}: Ω̂z never moves",
            f"{held('f', ours)}: K̂ does, Ω̂z stays {100 * rate:.0f} % off, D̂ by {damping:.0f} times D",
        ],
        [
            "g",
            "the bound estimates settle",
            f"{held('g', printed)}: they grow without end; the loop lasts",
            f"{held('g', ours)}, and the loop diverges after {ends:.1f} s: **worse than as printed**",
        ],
        [
            "h",
            "RMSE minimal at α = 0.9",
            f"{held('h', printed)}: in {best[printed]} of 6 columns",
            f"{held('h', ours)}: in {best[ours]} of 6 columns",
        ],
        [
            "i",
            "the fractional order costs more computation",
            *(f"{held('i', v)}: {cost[v]:.2f} times" for v in (printed, ours)),
        ],
    ]


def of_estimate(column: str) -> float:
    return number(cell("rate_estimation", column, case="the paper's: Ωz = 0.1, guess 0.095", t="80"))


PAPER: dict[str, Callable[[], str]] = {
    "claims.printed": lambda: holding("printed"),
    "claims.corrected": lambda: holding("corrected"),
    "loop.seeds": lambda: cell(
        "boundedness", "diverged", reading="as printed", layer="quadratic (its own)"
    ).removeprefix("0 of "),
    "loop.seconds": lambda: "{:.0f}".format(
        number(cell("boundedness", "run to t", reading="as printed", layer="quadratic (its own)")) / 1000
    ),
    "rate.bound": lambda: short(100 * of_estimate("bound, 1 σ"), 1),
    "order.x": lambda: said("best_order", r"minimal at α = ([\d.]+)\s+on x, [\d.]+ on y"),
    "order.y": lambda: said("best_order", r"minimal at α = [\d.]+\s+on x, ([\d.]+) on y"),
    "order.steady": lambda: said("best_order", r"from t = 10 on at ([\d.]+), [\d.]+ and [\d.]+\. "),
}

# -- docs/performance.md, README.md ------------------------------------------------------------------------------------


def milliseconds(cell: str) -> float:
    return number(cell) * {"s": 1000.0, "ms": 1.0, "us": 1e-3}[cell.split()[-1]]


def one_run(what: str, column: str = "median") -> str:
    return cell("one_run", column, **{"": what})


def peers(pattern: str) -> list[float]:
    rows = logs.rows("loop", "per step", "times ours")
    found = [number(row["times ours"]) for row in rows if row["section"] == "One run" and re.search(pattern, row[""])]
    if not found:
        raise ValueError(f"benchmarks/results/loop.md has no peer {pattern!r}")
    return found


def spread(values: list[float], count: int = 2) -> str:
    low, high = (thousands(float(f"{value:.{count}g}")) for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def performance() -> Rows:
    ours = "C++ only, memory reused"
    run = milliseconds(one_run(ours))
    reused, kept = (one_run(f"`fg.simulate`, {how}", "over C++ only") for how in ("memory reused", "every result kept"))
    python = milliseconds(cell("outside", "median", controller="PD, Python callable of plain floats"))
    numba = said("outside", r"takes ([\d.]+) times the time of the built-in")
    sweep = {name: cell("sweep_scaling", name, runs="1,000,000") for name in ("whole sweep", "peak memory")}
    # Both peaks scatter by a megabyte: the smaller may be of the larger sweep.
    each_run = max(0.0, float(said("sweep_scaling", r"memory grows by (-?[\d.]+) bytes")))
    own = cell("loop", "median", **{"": "fracgyro, C++"})
    vmap = cell("loop", "times ours", **{"": "JAX vmap over 256 runs"})
    many = cell("loop", "median", **{"": "fracgyro, `measure_many`"})
    each = {of: number(cell("batch", "now", **{"": of})) for of in BATCHES}
    errors = {
        of: cell("operator_accuracy", "largest error", method=f"exponentials, tolerance 1e-6, {of}")
        for of in ("double", "single")
    }
    times = [number(row["time"]) for row in logs.rows("kernel_design", "minimax", "time")]
    table = [
        row for row in logs.rows("best_order", "part", "runs", "seconds") if row["part"] == "Table 1, corrected law"
    ]
    whole, quick = (said("reproduction", pattern) for pattern in (r"reproduce` took (\S+) s", r"--quick` (\S+) s"))
    results = "../benchmarks/results"
    return [
        [
            "one run, 80,001 steps, every channel recorded, noise drawn, one thread, in C++",
            f"{run:.1f} ms ({run * 1e6 / 80_001:.0f} ns a step)",
            f"[one run]({results}/one_run.md)",
        ],
        [
            "… from Python, `fg.simulate`, on memory used before; with every result kept",
            f"{number(reused):.1f}; {number(kept):.1f} times as long",
            "same",
        ],
        [
            "Python callable of plain floats as controller; numba function, over the built-in PID",
            f"{python:.0f} ms; {numba} times as long",
            f"[outside]({results}/outside.md)",
        ],
        [
            "sweep of 1,000,000 runs of 100 steps, 2 threads, without quantiles",
            f"{number(sweep['whole sweep']):.1f} s, {sweep['peak memory']}; {each_run:.0f} bytes of memory a run",
            f"[sweeps]({results}/sweep_scaling.md)",
        ],
        [
            f"full-history implementations, over a run of {milliseconds(own):.1f} ms in C++: numba, NumPy, Octave",
            f"{spread(peers('numba, full'))}, {spread(peers('NumPy, full'))}, {spread(peers('Octave'))} times as long",
            f"[loop]({results}/loop.md)",
        ],
        [
            "… other implementations with the same exponentials: numba, JAX scan",
            f"{peers('numba, 21')[0]:.1f}, {peers('JAX scan')[0]:.0f} times as long",
            "same",
        ],
        [
            "many runs, metrics only, one thread: each with its own noise; all with the same",
            f"{each[BATCHES[0]]:.0f} ns; {each[BATCHES[1]]:.0f} ns a step",
            f"[batch]({results}/batch.md)",
        ],
        ["… the same in single precision", f"{each[BATCHES[2]]:.0f} ns; {each[BATCHES[3]]:.0f} ns a step", "same"],
        [
            f"JAX vmap, each with its own noise, over {1000 * number(many):.2f} ms a run",
            f"{number(vmap):.1f} times as long",
            f"[loop]({results}/loop.md)",
        ],
        [
            "Caputo derivative, α = 0.9, tolerance 1e-6, online",
            f"error {errors['double']} double, {errors['single']} single",
            f"[operators]({results}/operator_accuracy.md)",
        ],
        [
            "kernel design with a certified error bound",
            f"as many as minimax sets, {min(times):.0f} to {max(times):.0f} ms",
            f"[design]({results}/kernel_design.md)",
        ],
        [
            f"Table 1 with 10,000 seeds per order, {table[0]['runs']} runs",
            f"{number(table[0]['seconds']):.0f} s, 2 threads",
            "[best order](best_order.md)",
        ],
        [
            "the whole reproduction, 100 seeds, 2 cores",
            f"{whole} s; `--quick` {quick} s",
            f"[reproduction]({results}/reproduction.md)",
        ],
    ]


BATCHES = ("doubles, noise per run", "doubles, one noise", "floats, noise per run", "floats, one noise")
TRACKED = [("F", "0.0035"), ("F", "0.05"), ("P", "0.0035"), ("P", "0.05")]
STEADY = "steady, over the limit"


def section(information: str, ceiling: str) -> str:
    return f"class {information}, 1e-13 m/√Hz, chattering ≤ {ceiling}"


def tracked(contender: str, column: str) -> list[str]:
    """Cells of a contender in the four settings with noise, the limit among them."""
    return [cell("compare_track", column, section=section(*place), contender=contender) for place in TRACKED]


def steady(contender: str) -> list[float]:
    """Steady error over the limit, where the contender keeps the ceiling."""
    return [number(each) for each in tracked(contender, STEADY) if re.search(r"\d", each)]


def surfaces() -> str:
    """Largest difference of the paper's surface and the linear one, both on the filter, in percent."""
    pairs = zip(*(map(number, tracked(f"{name}_kalman", FOUND)) for name in ("paper", "linear")), strict=True)
    return f"{max(100 * abs(theirs / mine - 1) for mine, theirs in pairs):.0f}"


def at_resonance(names: tuple[str, ...], others: bool = False) -> list[float]:
    """Steady error over the limit on `dual_mass` of these contenders, or of all others."""
    rows = [r for r in logs.rows("compare_track", STEADY) if r["section"].startswith("dual_mass")]
    found = [r for r in rows if (r["contender"] in names) != others and "beyond a limit" not in r["remarks"]]
    return [number(r[STEADY]) for r in found if r["contender"] != "limit" and re.search(r"\d", r[STEADY])]


LEARN_THE_PLANT = ("lqg", "lqg_exact_delay", "paper_joint")


def runs() -> list[float]:
    return [
        1000 * number(cell("loop", "median", **{"": "fracgyro, C++"})),
        milliseconds(one_run("C++ only, memory reused")),
    ]


def extremes(name: str, of: Callable[[], list[float]], form: Callable[[float], str]) -> dict[str, Callable[[], str]]:
    """Two numbers: minimum and maximum."""
    return {f"{name}.low": lambda: form(min(of())), f"{name}.high": lambda: form(max(of()))}


def rounded(value: float) -> str:
    return thousands(float(f"{value:.2g}"))


def kilobytes(column: str) -> str:
    return f"{number(cell('web', column, file='fracgyro.wasm')) / 1000:.0f}"


OVERVIEW: dict[str, Callable[[], str]] = {
    **extremes("run", runs, lambda value: f"{value:.1f}"),
    **extremes("history", lambda: peers("full history"), rounded),
    **{
        key: of
        for name in ("internal_model", "lqg", "paper", "paper_kalman", "linear_kalman")
        for key, of in extremes(name, partial(steady, name), short).items()
    },
    "web.run": lambda: said("web", r"first time, then (\d+) ms"),
    "web.size": lambda: kilobytes("bytes"),
    "web.packed": lambda: kilobytes("gzipped"),
}

# -- docs/compare.md ---------------------------------------------------------------------------------------------------

CONTENDERS = {
    "lqg": "linear-quadratic, on a Kalman filter that learns the plant",
    "internal_model": "the same, on a filter that learns the sinusoids which the nominal plant lacks",
    "paper_joint": "the paper's surface on the filter of `lqg`",
    "paper_kalman": "the paper's on a Kalman filter of the nominal plant",
    "linear_kalman": "linear sliding mode on that filter",
    "pid_kalman": "PID on that filter",
    "integral_sliding_kalman": "integral surface, disturbance observer, on that filter",
    "integral_sliding": "the same, without a filter",
    "pid_least_squares": "PID on the plant that least squares find",
    "resonant": "PD with resonators",
    "paper": "the paper's, tuned",
    "paper_integer_order": "α = 1",
    "paper_no_terminal": "λ2 = 0",
    "pid": "PID",
    "paper_as_published": "the paper's, its own gains",
}
CONDITIONS = ("one step of delay", "one step of hidden delay", "12 bit", "0.7 of the force", "2h")
# Need of a reader, the contender, and its kind and sensing in the log of operations.
CHOICES = (
    ("sinusoidal references and a data sheet's noise", "internal_model", "internal_model", ""),
    ("the angular rate as well, or a motion at resonance", "lqg", "lqg", ""),
    ("a delay that is known exactly", "internal_model_exact_delay", "internal_model", ""),
    ("any reference, a small processor", "pid_kalman", "pid", ", filter"),
    ("any reference, with adaptation, the delay known", "linear_kalman", "linear", ", filter"),
    ("no noise densities", "resonant", "resonant", ""),
    ("the paper's law, as well as it can be tuned", "paper_kalman", "fractional_fast_terminal", ", filter"),
)
CHANGED = ("lqg", "internal_model", "paper_joint", "pid_kalman", "integral_sliding", "paper", "pid")
ERROR = "error over that without the change"
FOUND = "error, q0 (95 %)"
SENSED = "class P, 1e-13 m/√Hz"


def tracking() -> Rows:
    rows = [["limit", "of any controller", *(short(1e4 * number(each), 3) for each in tracked("limit", FOUND))]]
    for name, words in CONTENDERS.items():
        found = zip(tracked(name, FOUND), tracked(name, STEADY), tracked(name, "remarks"), strict=True)
        rows.append([f"`{name}`", words, *(times_limit(*each) for each in found)])
    return rows


def times_limit(error: str, over: str, remarks: str) -> str:
    if "beyond a limit" in remarks or not re.search(r"\d", over):
        return "above the ceiling"
    mark = "*" if "not converged" in remarks else ""
    return f"{short(1e4 * number(error), 3)}{mark} (× {short(number(over))})"


def changed(name: str, condition: str) -> list[str]:
    """Factors of the error of a contender by a condition, in the settings."""
    return [cell("compare_track", condition, **{"section": section(*place), ERROR: name}) for place in TRACKED]


def chooser() -> Rows:
    def between(values: list[float]) -> str:
        return f"{short(min(values), 3)} to {short(max(values), 3)}"

    rows = []
    for words, name, kind, kept in CHOICES:
        factors = changed(name, CONDITIONS[1])
        borne = "lost" if any("lost" in each for each in factors) else between([number(each) for each in factors])
        cost = ", ".join(operations(kind, f"{measured}{kept}") for measured in (BOTH, ONLY))
        rows.append([words, f"`{name}`", between(steady(name)), borne, cost])
    return rows


def under_changes() -> Rows:
    def of(name: str, condition: str) -> str:
        return ", ".join("lost" if "lost" in each else digits(each) for each in changed(name, condition))

    return [[f"`{name}`", *(of(name, condition) for condition in CONDITIONS)] for name in CHANGED]


def sensing_task() -> Rows:
    columns = (
        "angle random walk, deg/√h (95 %)",
        "angle random walk, equal total motion, deg/√h",
        "bias by dxy, deg/h",
        "the same, hidden delay, deg/h",
        "bias by drift of K, deg/h",
        "RMS by drift of K, deg/h",
        "start-up, ms",
    )
    rows = []
    for name in ("lqg", "paper_joint", "force_rebalance", "park_horowitz"):
        (found,) = (
            r
            for r in logs.rows("compare_rate", "section", columns[0])
            if (r["section"], r["contender"]) == (SENSED, name)
        )
        cells = [found.get(column, "not yet").split()[0] if column in found else "not yet" for column in columns]
        plain = [digits(each.replace("e−", "e-"), 3) for each in cells]
        mark = "\\*" if "not converged" in found["remarks"] else ""
        shown = [thousands(number(x)).replace("-", "−") if abs_of(x) >= 1e3 else x for x in plain]
        rows.append([f"`{name}`", shown[0] + mark, *shown[1:]])
    return [*rows, ["all others, `paper` among them", "no gains found", *[""] * (len(columns) - 1)]]


def hidden_step() -> str:
    """Noise of `lqg` with a hidden step of delay, over that without, with velocities measured."""
    place = {"section": "class F, 1e-13 m/√Hz", ERROR: "lqg"}
    return cell("compare_rate", CONDITIONS[1], **place)


def stiffer(name: str) -> float:
    """Noise at rest over that without the change, if the stiffness is 5 % larger."""
    return number(cell("compare_rate", "K +5 %", **{"section": SENSED, ERROR: name}))


def abs_of(text: str) -> float:
    return abs(number(text)) if re.search(r"\d", text) else 0.0


def operations(controller: str, measured: str) -> str:
    adaptation = "gradient" if controller in ("fractional_fast_terminal", "linear") else "–"
    return cell("flops", "flops", controller=f"`{controller}`", adaptation=adaptation, measured=measured)


BOTH, ONLY = "positions and velocities", "positions only"


COMPARE: dict[str, Callable[[], str]] = {
    "surfaces": surfaces,
    "unstated": lambda: f"{100 * (max(map(number, changed('internal_model', CONDITIONS[1]))) - 1):.0f}",
    "rate.lqg.hidden": lambda: f"{number(hidden_step()):.0f}",
    **extremes("resonance", partial(at_resonance, LEARN_THE_PLANT), short),
    "resonance.next": lambda: short(min(at_resonance(LEARN_THE_PLANT, others=True))),
    "rate.park.stiff": lambda: thousands(float(f"{stiffer('park_horowitz'):.2g}")),
    "rate.lqg.stiff": lambda: short(stiffer("lqg")),
    "rate.lqg_over": lambda: cell(
        "compare_rate", "over force rebalance's (95 %)", section=SENSED, contender="lqg"
    ).split()[0],
}

# -- docs/fpga.md ------------------------------------------------------------------------------------------------------

FPGA_ROWS = {
    "paper": "the paper's, its 22 exponentials",
    "16 exponentials": "16 exponentials",
    "8 exponentials": "8 exponentials",
    "8 exponentials, force limit": "8 exponentials, force limit",
    "8 exponentials, composite adaptation": "8 exponentials, composite adaptation",
    "PID, force limit": "PID, force limit",
}


def cycles() -> Rows:
    found = logs.rows("fpga", "controller", "cycles from start to force")
    columns = ("cycles from start to force", "from start to ready")
    rows = []
    for name, words in FPGA_ROWS.items():
        cells = []
        for scalar in ("float", "fixed"):
            of = [row for row in found if (row["controller"], row["computes in"]) == (name, scalar)]
            cells += [f"{number(of[0][column]):.0f}" if of else "" for column in columns]
        rows.append([words, *cells])
    return rows


def routed() -> Rows:
    found = logs.rows("fpga_route", "controller", "MHz")
    rows = []
    for name in dict.fromkeys(row["controller"] for row in found):
        fast, slow = (next(r for r in found if (r["controller"], r["grade"]) == (name, g)) for g in ("8", "6"))
        clock = [f"{numbers(row['MHz'])[2]:.0f}" for row in (fast, slow)]
        times = [[row[column] for row in (fast, slow)] for column in ("µs to the force", "µs a step")]
        words = name if "fixed" in name else f"{name}, float"
        rows.append(
            [words, *(" / ".join(pair) for pair in (clock, *times)), fast["LUT4"], fast["DSP"], fast["block RAM"]]
        )
    return rows


def slower() -> float:
    clocks = [numbers(row["MHz"]) for row in logs.rows("fpga_route", "controller", "MHz")]
    return max(100 * (1 - low / high) for _, low, high in clocks)


FPGA: dict[str, Callable[[], str]] = {
    "fpga.longest": lambda: "{:.0f}".format(
        numbers(cell("fpga", "from start to ready", controller="8 exponentials", **{"computes in": "float"}))[2]
    ),
    "fpga.slower": lambda: f"{slower():.0f}",
    "fpga.pid_programs": lambda: cell("fpga", "programs", controller="PID, force limit", **{"computes in": "float"}),
    "fpga.paper_programs": lambda: cell("fpga", "programs", controller="paper", **{"computes in": "float"}),
}

# -- docs/zoo.md -------------------------------------------------------------------------------------------------------

PART, WITH = "part", "error with it over that without, in noise"


def zoo_parts() -> Rows:
    """The effect of parts of laws, in noise and without."""
    return [[row[PART], row[WITH], row["without noise"]] for row in logs.rows("zoo", PART)]


def zoo_code() -> Rows:
    """The runs of the public code, error by error."""
    heads = ("run", "RMS of e_x after t = 5", "of e_y", "largest share of the bound", "leaves it at")
    return [[row[head] for head in heads] for row in logs.rows("zoo", *heads)]


def zoo_part(part: str) -> str:
    return digits(cell("zoo", WITH, **{PART: part}))


def zoo_law(entry: str, column: str) -> str:
    """A number of the table of laws, by the name of an entry."""
    (found,) = [row for row in logs.rows("zoo", "year", "Law") if f"({entry}," in row["Law"]]
    return digits(found[column])


ZOO = {
    "zoo.compensable": lambda: said("compensation", r"Of (\d+) laws that take it"),
    "zoo.compensated": lambda: said("compensation", r"take it, (\d+) have a smaller error"),
    "zoo.held": lambda: said("zoo", r"papers (\d+) are “reproduced”"),
    "zoo.verdicts": lambda: said("zoo", r"Of (\d+) verdicts on claims"),
    "zoo.nodes": lambda: zoo_part("16 Gaussian nodes instead of one constant node"),
    "zoo.fuzzy": lambda: zoo_part("fuzzy rules, products of memberships, instead of Gaussian nodes"),
    "zoo.loops": lambda: zoo_part("both loops"),
    "zoo.gate": lambda: zoo_part("a gate"),
    "zoo.moving": lambda: zoo_part("moving centers and widths"),
    "zoo.drift": lambda: zoo_law("2014_rbf_network", "Drift"),
    "zoo.bounds_drift": lambda: zoo_law("2020_fractional_fast_terminal", "Drift"),
    "zoo.funnel": lambda: zoo_law("2013_funnel", "over the limit"),
    "zoo.funnel_delay": lambda: zoo_law("2013_funnel", "Hidden delay"),
    "zoo.dynamic_surface": lambda: zoo_part("the filter of a dynamic surface"),
    "zoo.observer": lambda: said("zoo", r"is mostly rejected \| tuned \| [a-z ]+ \| the error is ([\d.]+) "),
    "zoo.prediction": lambda: zoo_part("learning from a prediction, too"),
    "zoo.prediction_delay": lambda: zoo_law("2020_composite_learning", "Hidden delay"),
}

TABLES: dict[str, Callable[[], Rows]] = {
    "real_electronics": real_electronics,
    "at_the_bound": at_the_bound,
    "faults": faults,
    "longer": longer,
    "trust": trust,
    "exact_sensors": exact_sensors,
    "exact_faults": exact_faults,
    "budgets": budgets,
    "reference_cost": reference_cost,
    "limit": limit,
    "near_limit": near_limit,
    "claims": claims,
    "zoo_parts": zoo_parts,
    "zoo_code": zoo_code,
    "performance": performance,
    "chooser": chooser,
    "tracking": tracking,
    "under_changes": under_changes,
    "sensing_task": sensing_task,
    "cycles": cycles,
    "routed": routed,
}
# -- README.md ---------------------------------------------------------------------------------------------------------

INSTALL: dict[str, Callable[[], str]] = {
    "install.light": lambda: said("stopwatch", r"Without extras: \d+ distributions, (\d+) MB"),
    "install.report": lambda: said("stopwatch", r"MB\. With `report`: \d+ distributions, (\d+) MB"),
    # From a wheel; after it stands the same from a clone.
    "install.picture": lambda: said("stopwatch", r"(?s)Without extras.*?First picture: after \d+ s, .*? (\d+) s"),
    "install.all": lambda: thousands(number(logs.row("install", extra="all")["MB"])),
    "install.processor": lambda: said("install", r"takes (\d+) s of processor time"),
    "install.seconds": lambda: said("install", r"processes, (\d+) s on this machine"),
}
NUMBERS: dict[str, Callable[[], str]] = {
    **INSTALL,
    **RATE_SENSOR,
    **FIRMWARE,
    **PAPER,
    **OVERVIEW,
    **COMPARE,
    **FPGA,
    **ZOO,
}
