from .folder import fpga as fpga
