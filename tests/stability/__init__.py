"""Stability: over wide ranges of parameters, and where things go wrong, a run ends right, warned, or with advice."""
