"""A scenario's controller as hardware: traced from the core, scheduled onto pipelined units, written as Verilog.

Reading order: folder.py, the entry point; graph.py (what the core computes), routines.py, schedule.py, microcode.py,
proof.py, template.py. command.py and target.py are what the command line of fracgyro loads.
"""

from fracgyro.extras import public

__getattr__, __dir__, __all__ = public(__name__, __file__, "export")
