"""Results: a row per packing and per point, the paper's tables, the filter that each slurry needs.

Imports from study and the rooms below it.
"""
