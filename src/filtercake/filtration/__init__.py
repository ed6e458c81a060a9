"""The filtration engineer's equations: resistance laws, the constant-pressure test, the drum filter.

Imports only from crystals and the ground; knows of no packing and no study.
"""
