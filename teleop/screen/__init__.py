"""What a participant sees: the window, the drive and its instruments, and the pages between."""
