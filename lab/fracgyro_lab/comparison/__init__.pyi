from .run import Compared as Compared
from .run import compare as compare
