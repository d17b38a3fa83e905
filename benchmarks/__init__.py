"""Repeatable measurements, printed as tables of ratios."""
