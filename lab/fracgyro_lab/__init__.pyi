from .comparison import Compared as Compared
from .comparison import compare as compare
from .paper import Claim as Claim
from .paper import Reproduction as Reproduction
from .paper import reproduce as reproduce
