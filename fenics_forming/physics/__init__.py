"""One field problem, or one group of virtual-power terms, in each module."""
