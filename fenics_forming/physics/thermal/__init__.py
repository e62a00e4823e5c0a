"""Heat: conduction in bodies, what their surfaces exchange, and one implicit step of it."""
