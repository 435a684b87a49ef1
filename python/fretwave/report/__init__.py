"""A run on one page of HTML: model, settings, results with their errors, pictures, and what it was made with."""
