"""How meshes are graded to corners of tools and to the edges of contacts: numbers that were measured."""

# CORNER_SIZE and the growth in meshing.generate were picked among nine pairs on the sticking billet, whose force
# they move by +-1 % without a trend: they say where to refine, and are no calibration.
CORNER_SIZE = 0.35      # of the mesh size, at sharp corners of tools: the flow is singular there
GROWTH = 0.2            # of the size per unit of distance from there
# ... and from the edge of a contact, where the side of the body folds down: it lands element by element, and with 0.15 the
# force of the billet goes up and down less (0.29 against 0.37 % rms of seven meshes in 20 steps, for 7 % more unknowns);
# with 0.1 a cylinder has an inverted cell at 59 % instead of later
EDGE_GROWTH = 0.15
CORNER_REACH = 2.0      # mesh sizes from the body within which corners and roundings of tools count
