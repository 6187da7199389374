"""What this machine, this Python and this environment are: looked at once, returned as values."""
