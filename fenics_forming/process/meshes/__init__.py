"""Meshes are renewed in the middle of a process: when, how, and what is carried over."""
