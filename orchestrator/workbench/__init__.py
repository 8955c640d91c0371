"""The workbench: a page on this machine's own address that runs the commands, each in a process of its own."""
