"""The acceleration of gravity."""

GRAVITY = 9806.65   # mm/s²
