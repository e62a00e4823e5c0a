"""Contact: closest points on tool surfaces, contact terms on rigid tools and between bodies."""
