"""What the report shows beside the figures: captions, readable tables, pages of prose."""
