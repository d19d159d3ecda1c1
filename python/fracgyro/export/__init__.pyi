from .firmware import firmware as firmware
from .fmu import fmu as fmu
from .live import live as live
from .matlab import matlab as matlab
from .operator import operator as operator
from .replay import Replay as Replay
from .replay import replay as replay
from .web import web as web
