"""Furniture that is made by numbers, one file for each."""
