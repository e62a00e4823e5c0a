"""Direct solution of the flow in the plane by dense fronts, on the order of elimination that its mesh suggests."""
