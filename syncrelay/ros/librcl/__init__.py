"""The librcl backend: serialized messages taken and published without a copy in Python."""
