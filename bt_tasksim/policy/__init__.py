"""Policies: what decides the action of a concept, and how a learned one is kept on disk."""
