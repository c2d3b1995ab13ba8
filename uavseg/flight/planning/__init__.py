"""Planning of missions: order, split and time flights; the top of `flight`."""
