from .allan import Allan as Allan
from .allan import allan as allan
from .bound import Bound as Bound
from .bound import bound_angle_random_walk as bound_angle_random_walk
from .characterise import characterise as characterise
from .of_record import analyse_record as analyse_record
from .results import Result as Result
