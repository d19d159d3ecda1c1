from . import control as control
from . import gymnasium as gymnasium
from . import scipy as scipy
