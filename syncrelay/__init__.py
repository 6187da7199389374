"""A ROS 2 relay that matches messages by time, told how by a YAML file."""


def own_version() -> str:
    """Return the installed version of syncrelay."""
    # Signals are not in hand yet when this package is imported.
    from importlib.metadata import PackageNotFoundError, distribution  # noqa: PLC0415

    try:
        metadata = distribution("syncrelay").metadata
    except PackageNotFoundError:
        return "unknown"
    # Of an installation that was removed by hand a folder may be left, which says nothing.
    if "Version" not in metadata:
        return "unknown"
    return metadata["Version"]
