"""Words of a plan that belong together, and the values that they become."""
