from . import limit as limit
from . import metrics as metrics
