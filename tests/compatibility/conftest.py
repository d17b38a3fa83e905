"""Samples are files of users: one of them is a test of theirs."""

collect_ignore = ["samples"]
