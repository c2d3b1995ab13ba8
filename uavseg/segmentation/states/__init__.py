"""Free, unknown and occupied: states of leaves refined to pixels."""
