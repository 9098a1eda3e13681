"""The loop, the study and the command line: where everything below is put together."""
