"""Engines in other processes: any role of the pipeline behind TCP, by ZeroMQ and msgpack."""
