"""A scenario's controller as hardware: traced from the core, scheduled onto pipelined units, written as Verilog."""

from .folder import fpga as fpga
