"""Verification: the package against closed forms and converged references (REFERENCES entries in the test names)."""
