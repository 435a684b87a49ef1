"""Case files: what they may say, and what is built from them."""
