"""One task on many recordings: resumable, on this machine's cores or on a Ray cluster; see docs/howto/fleet.md."""
