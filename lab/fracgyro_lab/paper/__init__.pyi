from .claims import Claim as Claim
from .reproduce import Reproduction as Reproduction
from .reproduce import reproduce as reproduce
