"""The path through librcl in machine code, where it was built."""
