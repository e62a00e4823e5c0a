"""Work-precision diagrams: error against CPU time, and against what was spent it on, for nine named cases."""
