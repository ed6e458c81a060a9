"""Running a workflow: jobs and progress, checksums, provenance, resuming and retrying.

Imports from study, packing and the ground, not from what is computed above them.
"""
