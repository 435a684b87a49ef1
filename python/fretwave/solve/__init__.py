"""Following branches, and what comes of it."""
