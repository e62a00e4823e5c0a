"""The linearised flow in space by an iterative solver; only bodies for which it is chosen import it."""
