"""Selection of regions by id, condition or size."""
