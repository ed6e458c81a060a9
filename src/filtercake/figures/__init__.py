"""Figures: one module per family, each taking a study's tables and returning a matplotlib Figure."""
