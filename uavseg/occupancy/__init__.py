"""What a robot believes of its surroundings, and the ways through them."""
