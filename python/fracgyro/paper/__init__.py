"""The paper, reproduced: `reproduce` makes every figure, Table 1, a verdict on every claim and the report."""

from .reproduce import Reproduction, reproduce

__all__ = ["Reproduction", "reproduce"]
