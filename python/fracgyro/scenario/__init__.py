"""A scenario: everything that a run depends on. Validated here, at the border, and nowhere else."""

from .messages import ScenarioError
from .scenario import Scenario, check_scenario

__all__ = ["Scenario", "ScenarioError", "check_scenario"]
