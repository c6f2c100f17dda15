"""Baseline controllers of one joint, from PD to learning."""
