"""Photographs taken from the air: where they were taken, and what ground they show."""
