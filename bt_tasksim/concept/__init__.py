"""Concept models: what a task is, its parameters, and the leaf that runs it."""
