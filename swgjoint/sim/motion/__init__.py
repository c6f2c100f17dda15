"""Commanded motions of joints and tool."""
