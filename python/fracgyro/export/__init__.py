"""A scenario as something that runs elsewhere: in a simulation tool, in a browser, on a microcontroller."""
