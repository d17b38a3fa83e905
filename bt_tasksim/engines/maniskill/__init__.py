"""Environments of ManiSkill as worlds: their physics, their pictures, and what they call success."""
