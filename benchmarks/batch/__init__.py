"""Many worlds at once: ``python -m benchmarks.batch [SECTION ...]``. Each section is one file."""
