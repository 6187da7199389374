"""One task on many recordings: resumable, on this machine's cores or on a Ray cluster. docs/fleet.md tells more."""
