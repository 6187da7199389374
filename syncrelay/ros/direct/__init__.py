"""The direct path: serialized messages taken and published in librcl, without a copy in Python."""
