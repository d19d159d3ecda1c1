from . import control as control
from . import scipy as scipy
