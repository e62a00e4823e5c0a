"""Heat of workpieces and tools from one time to the next, and what they exchange."""
