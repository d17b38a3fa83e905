"""What is left of a run: its log, its video, pictures of its tree and the report."""
