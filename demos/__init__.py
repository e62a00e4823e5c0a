"""Demos: each runs a process, compares it with reference values, draws it, and fails where it does not agree.

They are meant to be read; run them with ``python3 demos/NAME.py`` or from Python, ``demos.NAME.main()``.
"""
