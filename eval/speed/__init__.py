"""`tagtrack eval speed`: the compiled core beside a filter written to be read."""
