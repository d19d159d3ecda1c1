"""The gyroscope as a rate sensor: `fracgyro rate`, in the terms of IEEE Std 1431 and 952. Page one: characterise.py."""

from .allan import allan
from .bound import bound_angle_random_walk
from .characterise import characterise

__all__ = ["allan", "bound_angle_random_walk", "characterise"]
