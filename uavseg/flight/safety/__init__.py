"""What keeps a flight safe: limits, keep-out zones, home, fence, and the check of what was written."""
