"""
The compiled part of fracgyro: core/ and sim/. Use it through the Python package.
"""

import enum
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple, overload

import numpy
from numpy.typing import NDArray

_Vector = tuple[float, float]

class Motion(NamedTuple):
    """The motion that is measured at a sample."""

    time: float
    position: _Vector
    velocity: _Vector

class Sample:
    """What a controller is given at one sample: floats and pairs of floats, in SI units if run.units is SI."""
    @property
    def time(self) -> float: ...
    @property
    def position(self) -> _Vector: ...
    @property
    def velocity(self) -> _Vector: ...
    @property
    def reference(self) -> _Vector: ...
    @property
    def reference_velocity(self) -> _Vector: ...
    @property
    def reference_acceleration(self) -> _Vector: ...

compiler: str

class ExponentialSum:
    """Exponentials of the kernel t^(-order)/Gamma(1-order)."""

    def __init__(
        self,
        order: float,
        gamma: float,
        poles: Annotated[NDArray[numpy.float64], {"shape": (None,), "order": "C", "device": "cpu", "writable": False}],
        weights: Annotated[
            NDArray[numpy.float64], {"shape": (None,), "order": "C", "device": "cpu", "writable": False}
        ],
        error: float = 0.0,
    ) -> None: ...
    @property
    def count(self) -> int: ...
    @property
    def order(self) -> float: ...

kernel_capacity: int = 64

earliest: float = 1e-200

latest: float = 1e200

largest_ratio: float = 10000000000.0

smallest_tolerance: float = 1e-11

largest_tolerance: float = 0.1

def design_kernel(
    order: float, shortest: float, longest: float, tolerance: float
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], float]: ...
def designed_kernel(order: float, step: float, duration: float, tolerance: float) -> ExponentialSum: ...
def kernel(times: NDArray[Any], order: float) -> NDArray[numpy.float64]: ...
def apply_operator(
    values: Annotated[
        NDArray[numpy.float64], {"shape": (None, None), "order": "C", "device": "cpu", "writable": False}
    ],
    rates: Annotated[NDArray[numpy.float64], {"shape": (None, None), "order": "C", "device": "cpu", "writable": False}],
    kernel: ExponentialSum,
    step: float,
) -> NDArray[numpy.float64]: ...
def apply_operator_single(
    values: Annotated[
        NDArray[numpy.float32], {"shape": (None, None), "order": "C", "device": "cpu", "writable": False}
    ],
    rates: Annotated[NDArray[numpy.float32], {"shape": (None, None), "order": "C", "device": "cpu", "writable": False}],
    kernel: ExponentialSum,
    step: float,
) -> NDArray[numpy.float32]: ...
def sampled_operator(
    poles: NDArray[Any],
    weights: NDArray[Any],
    order: float,
    shortest: float,
    step: float,
    derivative: bool,
    parabolas: bool,
) -> tuple[NDArray[numpy.float64], tuple[float, float, float, float]]: ...

class Recursion:
    """A sum of first-order recursions: sampled_step.h."""

    def __init__(
        self,
        of_values: Annotated[
            NDArray[numpy.float64], {"shape": (None, 2), "order": "C", "device": "cpu", "writable": False}
        ],
        of_changes: Annotated[
            NDArray[numpy.float64], {"shape": (None, 2), "order": "C", "device": "cpu", "writable": False}
        ],
        gains: Sequence[float],
    ) -> None: ...
    def reset(self) -> None: ...
    def step(self, sample: float) -> float: ...
    def run(
        self, samples: Annotated[NDArray[numpy.float64], {"shape": (None,), "device": "cpu", "writable": False}]
    ) -> NDArray[numpy.float64]: ...
    @property
    def state(self) -> list[float]: ...
    @state.setter
    def state(self, arg: Sequence[float], /) -> None: ...

class RecursionSingle:
    """A sum of first-order recursions: sampled_step.h."""

    def __init__(
        self,
        of_values: Annotated[
            NDArray[numpy.float64], {"shape": (None, 2), "order": "C", "device": "cpu", "writable": False}
        ],
        of_changes: Annotated[
            NDArray[numpy.float64], {"shape": (None, 2), "order": "C", "device": "cpu", "writable": False}
        ],
        gains: Sequence[float],
    ) -> None: ...
    def reset(self) -> None: ...
    def step(self, sample: float) -> float: ...
    def run(
        self, samples: Annotated[NDArray[numpy.float32], {"shape": (None,), "device": "cpu", "writable": False}]
    ) -> NDArray[numpy.float32]: ...
    @property
    def state(self) -> list[float]: ...
    @state.setter
    def state(self, arg: Sequence[float], /) -> None: ...

trace: float = 1e-290

trace_single: float = 1e-24

def power(base: float, exponent: float) -> float:
    """base^exponent by the core's own log2/exp2."""

def philox(key: int, counter: Sequence[int]) -> list[int]:
    """One block of Philox4x32-10."""

def disturbance(setup: Setup, first: int, count: int, stream: int = 0) -> NDArray[numpy.float64]:
    """d at the steps first, first + 1, …."""

class Status(enum.Enum):
    ok = 0

    saturated = 1

    not_finite = 2

    out_of_range = 3

    restarted = 4

    implausible = 6

    lost = 7

class Controller:
    def __init__(self, setup: Setup, single: bool) -> None: ...
    def step(self, position: Sequence[float], velocity: Sequence[float]) -> list[float]: ...
    def checked_step(self, step: float, units: Units, time: object, position: object, velocity: object) -> Any: ...
    @property
    def report(self) -> list[float]: ...
    @property
    def steps(self) -> int: ...
    @property
    def status(self) -> Status: ...
    @property
    def state(self) -> bytes: ...
    @state.setter
    def state(self, arg: bytes, /) -> None: ...

controller_kinds: list[str]

controller_meanings: list[str]

def fields_of_kind(kind: int) -> list[dict[str, Any]]:
    """What each number of a run of this kind is, in order."""

def reports_of_kind(kind: int) -> list[tuple[tuple[str, int, str, str, str, bool], ...]]:
    """
    The channels that each of its types reports, as `chosen_type` counts them.
    """

class Profile:
    def __init__(self) -> None: ...
    @property
    def times(self) -> list[float]: ...
    @times.setter
    def times(self, arg: Sequence[float], /) -> None: ...
    @property
    def values(self) -> list[float]: ...
    @values.setter
    def values(self, arg: Sequence[float], /) -> None: ...

class AngularRateKind(enum.Enum):
    constant = 0

    staircase = 1

    sine = 2

    chirp = 3

    noise = 4

    table = 5

class AngularRateParams:
    def __init__(self) -> None: ...
    @property
    def kind(self) -> AngularRateKind: ...
    @kind.setter
    def kind(self, arg: AngularRateKind, /) -> None: ...
    @property
    def amplitude(self) -> float: ...
    @amplitude.setter
    def amplitude(self, arg: float, /) -> None: ...
    @property
    def start(self) -> int: ...
    @start.setter
    def start(self, arg: int, /) -> None: ...
    @property
    def hold(self) -> int: ...
    @hold.setter
    def hold(self, arg: int, /) -> None: ...
    @property
    def levels(self) -> int: ...
    @levels.setter
    def levels(self, arg: int, /) -> None: ...
    @property
    def frequency(self) -> float: ...
    @frequency.setter
    def frequency(self, arg: float, /) -> None: ...
    @property
    def final_frequency(self) -> float: ...
    @final_frequency.setter
    def final_frequency(self, arg: float, /) -> None: ...
    @property
    def seed(self) -> int: ...
    @seed.setter
    def seed(self, arg: int, /) -> None: ...
    @property
    def table(self) -> Profile: ...
    @table.setter
    def table(self, arg: Profile, /) -> None: ...
    @property
    def inertial(self) -> bool: ...
    @inertial.setter
    def inertial(self, arg: bool, /) -> None: ...

class Quantizer:
    def __init__(self) -> None: ...
    @property
    def bits(self) -> int: ...
    @bits.setter
    def bits(self, arg: int, /) -> None: ...
    def __call__(self, arg: Sequence[float], /) -> list[float]: ...
    @property
    def range(self) -> list[float]: ...
    @range.setter
    def range(self, arg: Sequence[float], /) -> None: ...

class AxesParams:
    def __init__(self) -> None: ...
    @property
    def misalignment(self) -> float: ...
    @misalignment.setter
    def misalignment(self, arg: float, /) -> None: ...
    @property
    def gain_error(self) -> list[float]: ...
    @gain_error.setter
    def gain_error(self, arg: Sequence[float], /) -> None: ...

class ImperfectionParams:
    def __init__(self) -> None: ...
    @property
    def position_noise(self) -> float: ...
    @position_noise.setter
    def position_noise(self, arg: float, /) -> None: ...
    @property
    def velocity_noise(self) -> float: ...
    @velocity_noise.setter
    def velocity_noise(self, arg: float, /) -> None: ...
    @property
    def position_flicker(self) -> float: ...
    @position_flicker.setter
    def position_flicker(self, arg: float, /) -> None: ...
    @property
    def velocity_flicker(self) -> float: ...
    @velocity_flicker.setter
    def velocity_flicker(self, arg: float, /) -> None: ...
    @property
    def position(self) -> Quantizer: ...
    @position.setter
    def position(self, arg: Quantizer, /) -> None: ...
    @property
    def velocity(self) -> Quantizer: ...
    @velocity.setter
    def velocity(self, arg: Quantizer, /) -> None: ...
    @property
    def actuator(self) -> Quantizer: ...
    @actuator.setter
    def actuator(self, arg: Quantizer, /) -> None: ...
    @property
    def pickoff(self) -> AxesParams: ...
    @pickoff.setter
    def pickoff(self, arg: AxesParams, /) -> None: ...
    @property
    def force(self) -> AxesParams: ...
    @force.setter
    def force(self, arg: AxesParams, /) -> None: ...
    @property
    def delay(self) -> int: ...
    @delay.setter
    def delay(self, arg: int, /) -> None: ...
    @property
    def stiffness_drift(self) -> float: ...
    @stiffness_drift.setter
    def stiffness_drift(self, arg: float, /) -> None: ...
    @property
    def damping_drift(self) -> float: ...
    @damping_drift.setter
    def damping_drift(self, arg: float, /) -> None: ...
    @property
    def temperature(self) -> Profile: ...
    @temperature.setter
    def temperature(self, arg: Profile, /) -> None: ...
    @property
    def bias_instability(self) -> float: ...
    @bias_instability.setter
    def bias_instability(self, arg: float, /) -> None: ...
    @property
    def rate_random_walk(self) -> float: ...
    @rate_random_walk.setter
    def rate_random_walk(self, arg: float, /) -> None: ...
    @property
    def cubic_stiffness(self) -> list[float]: ...
    @cubic_stiffness.setter
    def cubic_stiffness(self, arg: Sequence[float], /) -> None: ...

def plant_map(setup: Setup) -> list[list[float]]:
    """
    Rows x, y, vx, vy after one step; columns x, y, vx, vy, force x, force y before it.
    """

class Setup:
    @property
    def kind(self) -> int: ...
    @property
    def steps(self) -> int: ...
    @property
    def has_memory(self) -> bool: ...
    @property
    def kernel(self) -> ExponentialSum: ...
    @kernel.setter
    def kernel(self, arg: ExponentialSum, /) -> None: ...
    @property
    def observer_bandwidth(self) -> float: ...
    @observer_bandwidth.setter
    def observer_bandwidth(self, arg: float, /) -> None: ...
    @property
    def seed(self) -> int: ...
    @seed.setter
    def seed(self, arg: int, /) -> None: ...

class DeviceSetup(Setup):
    @overload
    def __init__(self, kind: int, settings: Sequence[float]) -> None:
        """The kind's place in controller_kinds; numbers in its fields' order."""

    @overload
    def __init__(self, arg: DeviceSetup, /) -> None: ...
    @property
    def rate(self) -> AngularRateParams: ...
    @rate.setter
    def rate(self, arg: AngularRateParams, /) -> None: ...
    @property
    def device(self) -> ImperfectionParams: ...
    @device.setter
    def device(self, arg: ImperfectionParams, /) -> None: ...

class Units:
    def __init__(self) -> None: ...
    @property
    def time(self) -> float: ...
    @time.setter
    def time(self, arg: float, /) -> None: ...
    @property
    def length(self) -> float: ...
    @length.setter
    def length(self, arg: float, /) -> None: ...
    @property
    def velocity(self) -> float: ...
    @velocity.setter
    def velocity(self, arg: float, /) -> None: ...
    @property
    def acceleration(self) -> float: ...
    @acceleration.setter
    def acceleration(self, arg: float, /) -> None: ...
    @property
    def force(self) -> float: ...
    @force.setter
    def force(self, arg: float, /) -> None: ...
    @property
    def rate(self) -> float: ...
    @rate.setter
    def rate(self, arg: float, /) -> None: ...

class Law:
    pass

class PythonLaw(Law):
    def __init__(self, controller: object) -> None: ...
    @property
    def failed_at(self) -> float | None: ...
    @property
    def names(self) -> list[tuple[str, int]]: ...

class NativeLaw(Law):
    def __init__(
        self, address: int, state_size: int, parameters: Sequence[float], reports: int, rate_place: int
    ) -> None: ...
    @property
    def state(self) -> list[float]: ...
    @state.setter
    def state(self, arg: Sequence[float], /) -> None: ...

def record_laws(
    setups: Sequence[DeviceSetup],
    laws: Sequence[Law],
    units: Sequence[Units],
    every: int,
    device: bool,
    native: bool,
    threads: int,
) -> list[tuple[NDArray[numpy.float64], int | None]]:
    """(rows, samples before divergence) of each run."""

def law_rate_means(
    setups: Sequence[DeviceSetup],
    laws: Sequence[Law],
    units: Sequence[Units],
    every: int,
    block: int,
    native: bool,
    threads: int,
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]:
    pass

def measure_laws(
    setups: Sequence[DeviceSetup],
    laws: Sequence[Law],
    units: Sequence[Units],
    params: MetricsParams,
    native: bool,
    threads: int,
) -> NDArray[numpy.float64]:
    """Metrics of all runs, (runs, metrics)."""

class Gyroscope:
    def __init__(self, setup: DeviceSetup, units: Units) -> None: ...
    @property
    def motion(self) -> Motion: ...
    def step(self, force: object) -> Any: ...
    @property
    def state(self) -> bytes: ...
    @state.setter
    def state(self, arg: bytes, /) -> None: ...

class Loop:
    def __init__(self, setup: DeviceSetup) -> None: ...
    def run(self, samples: int, device: bool) -> object: ...
    def set(self, setup: DeviceSetup) -> bool: ...
    @property
    def steps(self) -> int: ...
    @property
    def state(self) -> bytes: ...
    @state.setter
    def state(self, arg: bytes, /) -> None: ...

def law_loop(setup: DeviceSetup, law: Law, units: Units) -> Loop: ...

class Gyroscopes:
    def __init__(self, setups: Sequence[DeviceSetup]) -> None: ...
    def rows(self) -> NDArray[numpy.float64]: ...
    def step(
        self,
        actions: Annotated[NDArray[numpy.float64], {"order": "C", "device": "cpu", "writable": False}],
        acted: int,
        limit: float,
    ) -> NDArray[numpy.float64]: ...
    def restart(self, place: int, setup: DeviceSetup) -> None: ...
    @property
    def state(self) -> bytes: ...
    @state.setter
    def state(self, arg: bytes, /) -> None: ...

def setup_settings(setup: Setup) -> list[float]:
    """The numbers of a run, in the order of fields_of_kind."""

def device_settings(setup: DeviceSetup) -> list[float]:
    """
    The numbers of its rate and device, as take_device_settings takes them.
    """

def setup_kernel(setup: Setup) -> tuple[list[float], list[float]]:
    """
    The exponentials' poles and weights; none where the controller has no memory.
    """

class MetricsParams:
    def __init__(self) -> None: ...
    @property
    def transient(self) -> float: ...
    @transient.setter
    def transient(self, arg: float, /) -> None: ...
    @property
    def error_bound(self) -> float: ...
    @error_bound.setter
    def error_bound(self, arg: float, /) -> None: ...
    @property
    def surface_bound(self) -> float: ...
    @surface_bound.setter
    def surface_bound(self, arg: float, /) -> None: ...
    @property
    def rate_tolerance(self) -> float: ...
    @rate_tolerance.setter
    def rate_tolerance(self, arg: float, /) -> None: ...

def record_runs(
    setups: Sequence[DeviceSetup], every: int, threads: int, device: bool = False
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def rate_means(
    setups: Sequence[DeviceSetup], every: int, block: int, threads: int, device: bool
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def lane_counts() -> list[int]: ...
def measure_runs(
    setups: Sequence[DeviceSetup], params: MetricsParams, threads: int, lanes: int, single_precision: bool = False
) -> NDArray[numpy.float64]: ...
def measure_run(setup: DeviceSetup, params: MetricsParams) -> NDArray[numpy.float64]: ...

metric_names: list[str]

loop_channels: tuple[tuple[str, int, str, str, str, bool], ...]

device_channels: tuple[tuple[str, int, str, str, str, bool], ...]

def coefficients(setup: Setup, single: bool) -> object:
    """
    The coefficients, nested as the structs are: a tuple for each struct, a list for each array.
    """

def state_size(setup: Setup, capacity: int, single: bool) -> int: ...
def chosen_type(setup: Setup) -> tuple[int, int]:
    """
    The line of the registry, and which of its types; as RegisteredController takes them.
    """
