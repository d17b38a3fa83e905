"""The experiments of the paper, each a command: ``python -m benchmarks.experiments A`` to ``F``."""
