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
    """Descriptions of the numbers of a run of this kind, in order."""

def device_fields() -> list[dict[str, Any]]:
    """
    Descriptions of the numbers of a moving rate and a real device, in order.
    """

def reports_of_kind(kind: int) -> list[tuple[tuple[str, int, str, str, str, bool], ...]]:
    """
    The channels that each of its types reports, as `chosen_type` counts them.
    """

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
    def set_device(
        self,
        settings: Sequence[float],
        rate: tuple[Sequence[float], Sequence[float]],
        temperature: tuple[Sequence[float], Sequence[float]],
        seed: int,
    ) -> None:
        """
        Numbers of the rate and the device in the order of device_fields; times, in steps, and values of the rate and of the change of temperature; the seed of the rate.
        """

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

class UserController:
    pass

class PythonController(UserController):
    def __init__(self, controller: object) -> None: ...
    @property
    def failed_at(self) -> float | None: ...
    @property
    def names(self) -> list[tuple[str, int]]: ...

class NativeController(UserController):
    def __init__(
        self, address: int, state_size: int, parameters: Sequence[float], reports: int, rate_place: int
    ) -> None: ...
    @property
    def state(self) -> list[float]: ...
    @state.setter
    def state(self, arg: Sequence[float], /) -> None: ...

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
    @overload
    def __init__(self, setup: DeviceSetup) -> None: ...
    @overload
    def __init__(self, setup: DeviceSetup, user: UserController, units: Units) -> None: ...
    def run(self, samples: int, device: bool) -> object: ...
    def set(self, setup: DeviceSetup) -> bool: ...
    @property
    def steps(self) -> int: ...
    @property
    def state(self) -> bytes: ...
    @state.setter
    def state(self, arg: bytes, /) -> None: ...

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
    setups: Sequence[DeviceSetup],
    every: int,
    threads: int,
    device: bool = False,
    users: Sequence[UserController] = [],
    units: Sequence[Units] = [],
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def rate_means(
    setups: Sequence[DeviceSetup],
    every: int,
    block: int,
    threads: int,
    device: bool,
    users: Sequence[UserController] = [],
    units: Sequence[Units] = [],
) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...
def lane_counts() -> list[int]: ...
def measure_runs(
    setups: Sequence[DeviceSetup], params: MetricsParams, threads: int, lanes: int, single_precision: bool = False
) -> NDArray[numpy.float64]: ...
def measure_device_runs(
    setups: Sequence[DeviceSetup],
    params: MetricsParams,
    threads: int = 1,
    users: Sequence[UserController] = [],
    units: Sequence[Units] = [],
) -> NDArray[numpy.float64]: ...

metrics: tuple[tuple[str, int, str, str, str, bool], ...]

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
