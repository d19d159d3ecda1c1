"""Runs: a scenario, or a controller from outside, in the compiled loop; recorded, measured or step by step."""
