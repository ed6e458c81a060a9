"""From filtration tests back to the material: measurements, their pooling, the fit, and the rounds of packings for it.

Imports from results and the rooms below it.
"""
