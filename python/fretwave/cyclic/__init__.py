"""Wheels of equal sectors: waves, faces, aerodynamic coupling, reduction."""
