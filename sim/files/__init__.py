"""Files and the machine they are on: durable writes, locks, output folders, versions."""
