"""The ``swgjoint`` command."""
