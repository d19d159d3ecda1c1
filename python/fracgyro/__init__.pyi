"""Public names of `import fracgyro`; each is loaded when it is first used."""

from . import export as export
from . import fractional as fractional
from . import interop as interop
from . import rate as rate
from . import study as study
from ._core import Motion as Motion
from ._core import Sample as Sample
from .analysis import limit as limit
from .analysis import metrics as metrics
from .analysis.plots import plot as plot
from .devices.sheet import device as device
from .export.parity import SelfCheck as SelfCheck
from .export.parity import selfcheck as selfcheck
from .identification.entry import identify as identify
from .rate.datasheet import datasheet as datasheet
from .scenario import Scenario as Scenario
from .scenario import ScenarioError as ScenarioError
from .scenario.cite import cite as cite
from .simulation import native as native
from .simulation.controller import Controller as Controller
from .simulation.measure import measure_many as measure_many
from .simulation.plant import Loop as Loop
from .simulation.plant import Plant as Plant
from .simulation.simulate import DivergedError as DivergedError
from .simulation.simulate import simulate as simulate
from .simulation.simulate import simulate_many as simulate_many
from .simulation.user_controller import ControllerError as ControllerError
from .simulation.user_plant import PlantError as PlantError
from .study.json_schema import schema as schema

__version__: str
