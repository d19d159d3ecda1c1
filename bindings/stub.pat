# Types that nanobind.stubgen cannot know, and values that depend on the machine.
_core.__prefix__:
    \from typing import Any, NamedTuple
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
        @property
        def error(self) -> _Vector: ...
        @property
        def error_rate(self) -> _Vector: ...

_core.compiler:
    compiler: str

_core.design_kernel:
    def design_kernel(order: float, shortest: float, longest: float, tolerance: float) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], float]: ...

_core.sampled_operator:
    def sampled_operator(poles: NDArray[Any], weights: NDArray[Any], order: float, shortest: float, step: float, derivative: bool, parabolas: bool) -> tuple[NDArray[numpy.float64], tuple[float, float, float, float]]: ...

_core.kernel$:
    def kernel(times: NDArray[Any], order: float) -> NDArray[numpy.float64]: ...

_core.(controller_kinds|controller_meanings|plant_kinds|plant_meanings|sine_drives|two_sine_drives):
    \1: list[str]

_core.plant_takes_rate:
    plant_takes_rate: list[bool]

_core.(loop_channels|device_channels|volts_channels|metrics):
    \1: tuple[tuple[str, int, str, str, str, bool], ...]

_core.fields_of_kind:
    def fields_of_kind(kind: int) -> list[dict[str, Any]]:
        \doc

_core.fields_of_plant:
    def fields_of_plant(kind: int) -> list[dict[str, Any]]:
        \doc

_core.device_fields:
    def device_fields() -> list[dict[str, Any]]:
        \doc

_core.electronics_fields:
    def electronics_fields() -> list[dict[str, Any]]:
        \doc

_core.electrode_fields:
    def electrode_fields() -> list[dict[str, Any]]:
        \doc

_core.trim_fields:
    def trim_fields() -> list[dict[str, Any]]:
        \doc

_core.term_fields:
    def term_fields() -> list[dict[str, Any]]:
        \doc

_core.reports_of_kind:
    def reports_of_kind(kind: int) -> list[tuple[tuple[str, int, str, str, str, bool], ...]]:
        \doc

_core.PythonController.failed_at:
    @property
    def failed_at(self) -> float | None: ...

_core.PythonPlant.failed_at:
    @property
    def failed_at(self) -> float | None: ...

_core.PythonController.names:
    @property
    def names(self) -> list[tuple[str, int]]: ...

_core.chosen_type:
    def chosen_type(setup: Setup) -> tuple[int, int]:
        \doc

_core.Controller.checked_step:
    def checked_step(self, step: float, units: Units, time: object, position: object, velocity: object) -> Any: ...

_core.record_runs:
    def record_runs(setups: Sequence[DeviceSetup], every: int, threads: int, device: int = 0, users: Sequence[UserController] = [], units: Sequence[Units] = []) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...

_core.rate_means:
    def rate_means(setups: Sequence[DeviceSetup], every: int, block: int, threads: int, device: bool, users: Sequence[UserController] = [], units: Sequence[Units] = []) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...

_core.Gyroscope.motion:
    @property
    def motion(self) -> Motion: ...

_core.Gyroscope.step:
    def step(self, force: object) -> Any: ...
