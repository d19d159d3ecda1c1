from .sweep.run import Sweep as Sweep
from .sweep.run import sweep as sweep
from .tune.run import Tuned as Tuned
from .tune.run import tune as tune
