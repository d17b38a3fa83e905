"""Damaged and malicious inputs of every kind, and what the program makes of them.

``python -m tests.attacks KIND --cases N --seed S`` counts right results, clear errors and violations.
"""
