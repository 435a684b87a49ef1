"""Structures with contact: matrices, laws, modes, reduction."""
