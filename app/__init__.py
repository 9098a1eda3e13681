"""The command line, one file a verb, and the console: where everything is put together."""
