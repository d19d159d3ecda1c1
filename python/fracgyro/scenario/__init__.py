"""A scenario: everything that a run depends on. Validated here, at the border, and nowhere else."""

from .scenario import Scenario, check_scenario
from .sentences import ScenarioError

__all__ = ["Scenario", "ScenarioError", "check_scenario"]
