"""The commands of ``bt-tasksim``, one file each; a file says all about its command."""
