"""Everything between two solves: moving the material, choosing the step, keeping the state."""
