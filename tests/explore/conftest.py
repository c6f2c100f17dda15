"""Fixtures of this folder."""

from cut_bench import bench

__all__ = ["bench"]
