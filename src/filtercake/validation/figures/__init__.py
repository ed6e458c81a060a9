"""Figures of the pages that prove the product; each module takes tables and returns a figure."""
