"""Errors that reach the user as one line, each with the exit code that main.py returns."""


class SeepError(Exception):
    """Base of every error a user may meet: `str(error)` is the line printed, `exit_code` the status."""

    exit_code = 1


class ConfigError(SeepError):
    """Bad input: names file, key, value and the allowed range. Nothing has been written."""

    exit_code = 2


class DivergedError(SeepError):
    """The run is no longer physics: what failed, when, where, which limit, what to change."""

    exit_code = 3


class CapacityError(SeepError):
    """A declared maximum or the memory does not hold what the scene asks for."""

    exit_code = 4


class RunError(SeepError):
    """Disk, device or run folder failed; the last good state is kept."""

    exit_code = 4


class MissedError(SeepError):
    """A study's figure lies beyond its bound: names row, figure, value and bound."""

    exit_code = 1
