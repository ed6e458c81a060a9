"""What crystallizers and filters cost, for choosing between designs.

Imports from the study (its types of values and its checks) and all below.
"""
