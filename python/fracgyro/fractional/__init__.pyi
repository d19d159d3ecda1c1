from . import full_history as full_history
from .kernel import ExponentialSum as ExponentialSum
from .kernel import design as design
from .operators import caputo as caputo
from .operators import integral as integral
from .operators import riemann_liouville as riemann_liouville
from .pid import pid as pid
from .sampled import Sampled as Sampled
