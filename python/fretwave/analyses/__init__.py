"""The kinds of analysis, each a file of its name with everything that is known of it alone."""

#: In the order in which they are listed.
KINDS = ("static", "linear", "mode", "forced", "flutter", "free_decay", "limit_cycle", "sweep", "wear")
