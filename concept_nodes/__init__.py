"""Concepts and conditions, one file each."""
