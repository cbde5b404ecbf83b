"""Geometry only: shapes, ray casts, closest points. Knows no constraint and no velocity."""
