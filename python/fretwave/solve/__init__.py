"""Solutions in sequence: branches, preload, time integration, wear."""
