"""Reads frozen study records and draws them; never runs anything."""
