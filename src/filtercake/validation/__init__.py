"""What proves the product and is no part of it: benchmarks, agreement of engines, stress tests, twins, their pages.

Nothing imports from here; it may import from every room but cli.
"""
