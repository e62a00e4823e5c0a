"""What the tools do in a run: drives, and bodies that deform with the workpiece."""
